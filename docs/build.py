"""Build the documentation site: `python docs/build.py` (or `make docs`).

Collects the pages in results/site/source: docs/, README.md as the first page, the other Markdown
files of the root, and an API reference with one page for each room (a folder of a package). The
generator turns them into results/site/html. Its only configuration is mkdocs.yml, so another
generator that reads this file needs no change here. The schemas of the documents come from
`flowslide schema`; nothing else of flowslide runs.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SOURCE = ROOT / "results" / "site" / "source"
HTML = ROOT / "results" / "site" / "html"
SCHEMAS = ("settings", "result", "posterior", "joint", "verdict", "card")
SHIM = "https://unpkg.com/iframe-worker/shim"
PACKAGES = (
    "flowslide", "pipeline", "geometry", "mpm_taichi", "gns", "inversion", "diagnosis", "report",
)  # fmt: skip
#: Files outside docs/ that the site shows, and the places where it shows them.
OTHERS = {
    "README.md": "index.md",
    "CHANGELOG.md": "changelog.md",
    "CONTRIBUTING.md": "contributing.md",
    "CITATION.cff": "CITATION.cff",
    "models/thrust/worst.png": "models/thrust/worst.png",
}


def rooms(package: str) -> dict[str, list[str]]:
    """Modules by room: `geometry.scenes` -> `geometry.scenes`, `geometry.scenes.fill`, ..."""
    found: dict[str, list[str]] = {}
    for path in sorted((ROOT / package).rglob("*.py")):
        room = ".".join(path.relative_to(ROOT).parent.parts)
        if path.stem == "__init__":
            found.setdefault(room, []).insert(0, room)
        elif not path.stem.startswith("_"):
            found.setdefault(room, []).append(f"{room}.{path.stem}")
    return dict(sorted(found.items()))


def collect() -> None:
    """Make results/site/source."""
    shutil.rmtree(SOURCE, ignore_errors=True)
    ignored = shutil.ignore_patterns("build.py", "__pycache__", "README.md")
    shutil.copytree(ROOT / "docs", SOURCE, ignore=ignored)
    for page in SOURCE.rglob("*.md"):
        text = page.read_text("utf-8")
        page.write_text(re.sub(r"\]\(((?:\.\./)*)\.\./models/", r"](\1models/", text), "utf-8")
    for source, place in OTHERS.items():
        target = SOURCE / place
        target.parent.mkdir(parents=True, exist_ok=True)
        if target.suffix == ".md":
            text = re.sub(r"\]\(docs/", "](", (ROOT / source).read_text("utf-8"))
            name = r"\]\((CHANGELOG|CONTRIBUTING)\.md"
            target.write_text(re.sub(name, lambda m: f"]({m[1].lower()}.md", text), "utf-8")
        else:
            shutil.copy(ROOT / source, target)
    index = ["# API reference\n", "One page for every room, made from the docstrings.\n"]
    (SOURCE / "reference").mkdir()
    for package in PACKAGES:
        for room, modules in rooms(package).items():
            text = (
                f"---\nsearch:\n  boost: 0.3\n---\n\n# {room}\n\n"
                + "\n\n".join(f"::: {name}" for name in modules)
                + "\n"
            )
            (SOURCE / "reference" / f"{room}.md").write_text(text, "utf-8")
            index.append(f"{'  ' * room.count('.') * 2}- [{room}]({room}.md)")
    (SOURCE / "reference" / "index.md").write_text("\n".join(index) + "\n", "utf-8")
    (SOURCE / "schemas").mkdir()
    for name in SCHEMAS:
        command = [sys.executable, "-P", "-m", "flowslide", "schema", name]
        text = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout
        (SOURCE / "schemas" / f"{name}.json").write_text(text, "utf-8")


def make_search_local() -> None:
    """Replace the one script that the theme loads from the network, for search from the disk."""
    for page in HTML.rglob("*.html"):
        up = "../" * (len(page.relative_to(HTML).parts) - 1)
        text = page.read_text("utf-8").replace(SHIM, f"{up}search_from_disk.js")
        page.write_text(text, "utf-8")


def main() -> int:
    """Collect the pages and run the generator; its warnings are errors."""
    collect()
    command = [sys.executable, "-m", "mkdocs", "build", "--strict"]
    # Newer versions of the theme print advertising for another generator.
    environment = os.environ | {"NO_MKDOCS_2_WARNING": "1"}
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True)
    for line in done.stderr.splitlines():
        if not line.startswith("INFO"):
            print(line, file=sys.stderr)
    if not done.returncode:
        make_search_local()
        print("results/site/html/index.html")
    return done.returncode


if __name__ == "__main__":
    sys.exit(main())
