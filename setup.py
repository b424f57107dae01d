"""The build step of the wheel: case histories, models and settings go along as package data.

Everything else about the distribution is in pyproject.toml. In a clone these folders are found next
to the packages (`pipeline.places`); in a wheel they lie in `flowslide_data/`.
"""

import shutil
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py

ROOT = Path(__file__).resolve().parent
DATA = ("case_histories", "config", "models")


class BuildWithData(build_py):
    """Copies the shipped folders next to the packages."""

    def run(self) -> None:
        """Build the packages, then copy the data; an editable install reads the clone."""
        super().run()
        if not self.editable_mode:
            for name in DATA:
                target = Path(self.build_lib) / "flowslide_data" / name
                shutil.rmtree(target, ignore_errors=True)
                shutil.copytree(ROOT / name, target)


setup(cmdclass={"build_py": BuildWithData})
