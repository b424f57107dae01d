"""The build step of the wheel: data go along, and the readme loses what an index page cannot show.

Everything else about the distribution is in pyproject.toml. In a clone the folders of data lie next
to the packages (`pipeline.places`), in a wheel in `flowslide_data/`.
"""

import re
import shutil
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py

ROOT = Path(__file__).resolve().parent
DATA = ("case_histories", "config", "models")
NOT_DATA = shutil.ignore_patterns("__pycache__", "*.pyc", ".*")


class BuildWithData(build_py):
    """Copies the shipped folders next to the packages."""

    def run(self) -> None:
        """Build the packages, then copy the data; an editable install reads the clone."""
        super().run()
        if not self.editable_mode:
            for name in DATA:
                target = Path(self.build_lib) / "flowslide_data" / name
                shutil.rmtree(target, ignore_errors=True)
                shutil.copytree(ROOT / name, target, ignore=NOT_DATA)


def readme() -> str:
    """README.md without pictures, and with links to other files as plain text."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    link = r"\[([^\]]*)\]\((?![a-z]+:|#)[^)]*\)"
    text = re.sub(rf"^!{link}\n+", "", text, flags=re.MULTILINE)
    text = re.sub(rf"\s\({link}(?:,\s+{link})*\)", "", text)  # "(how)" alone says nothing
    return re.sub(link, r"\1", text)


setup(
    cmdclass={"build_py": BuildWithData},
    long_description=readme(),
    long_description_content_type="text/markdown",
)
