"""How large packages, rooms and the documentation may become; names of classes; the formatter."""

from __future__ import annotations

import ast
import re
from collections import defaultdict
from functools import cache
from pathlib import Path

from tests.test_layout import FILES, PRESENT, ROOT, relative, tree_of

PACKAGES = [*PRESENT, "benchmarks"]
WITHOUT_ROOMS = {"pipeline"}

# Lines of Python of each package, of each of its rooms, and of the files at its top. What needs
# more room takes it from elsewhere, or says here what it adds. The limits are what there was when
# they were set, and 2 % more. Before that the packages grew by whole features: slides without a
# drawn section (geometry/dimensions, inversion/new_case), pore water (mpm_taichi/solver), one
# relation over several slides (inversion/joint), a posterior and a deposit in plan in three
# dimensions (inversion/posterior, prediction), the studio with drawing, jobs and bodies
# (flowslide/studio). Since then: what a section with pore water lacks (geometry/scenes, 40 lines);
# answers of a diagnosis, and why its thresholds are what they are (diagnosis/*.py, 70 lines, which
# flowslide/commands gives); an effect that widens the slide, with a hook of its own
# (mpm_taichi/effects, 220 lines); a diagnosis in one picture: what each measurement asks for
# (diagnosis/verdict, 70 lines), its rows and its chart (report, 210 lines, of three charts less);
# other methods on the blind slides (benchmarks/hidden_effects/baselines, 1,100 lines), and a third
# code that makes them (benchmarks/hidden_effects/foreign, 450 lines); why the numbers of
# each step of a diagnosis are what they are (diagnosis, 70 lines); examples of a session
# (flowslide/*.py, 10 lines); a diagnosis of a body: its question (diagnosis/*.py, 220 lines),
# what is on trial of it, its model, and sizes that are refused (diagnosis/hypotheses, 400 lines),
# how the interface opens it (flowslide/*.py, 20 lines), the soil that both kinds of setup have
# (inversion/estimation, 15 lines); sentences of a verdict, which diagnosis/verdict gives
# (report/sentences, 150 lines), and the reasons in their place (diagnosis/*.py, 30 lines). Effects
# as inputs of the direct model, and a training that begins with a model (gns/direct, 230 lines);
# one class of an unknown (inversion/problem, 190 lines, which inversion/estimation and posterior
# give); assumptions of which one replaces the other (diagnosis/hypotheses, 50 lines), and lines the
# wrong way round (report/*.py, 20 lines).
LINES = {
    "pipeline": 2500,
    "geometry": 11220,
    "geometry/*.py": 360,
    "geometry/dimensions": 730,
    "geometry/random_scenes": 1830,
    "geometry/scenes": 2860,
    "geometry/scenes3d": 570,
    "geometry/survey": 3850,
    "geometry/survey3d": 770,
    "geometry/terrain": 330,
    "mpm_taichi": 13000,
    "mpm_taichi/*.py": 3050,
    "mpm_taichi/effects": 3700,
    "mpm_taichi/materials": 480,
    "mpm_taichi/solver": 4110,
    "mpm_taichi/solver3d": 1760,
    "gns": 9710,
    "gns/*.py": 30,
    "gns/data": 2430,
    "gns/direct": 2180,
    "gns/evaluation": 980,
    "gns/network": 2060,
    "gns/rollout": 770,
    "gns/training": 1460,
    "inversion": 24400,
    "inversion/*.py": 30,
    "inversion/back_analysis": 5240,
    "inversion/catalogue": 560,
    "inversion/classical": 3430,
    "inversion/engines": 3720,
    "inversion/estimation": 4090,
    "inversion/joint": 1250,
    "inversion/new_case": 1030,
    "inversion/posterior": 2070,
    "inversion/prediction": 2050,
    "inversion/problem": 1230,
    "diagnosis": 10980,
    "diagnosis/*.py": 1940,
    "diagnosis/adequacy": 710,
    "diagnosis/hypotheses": 3000,
    "diagnosis/selection": 3040,
    "diagnosis/signatures": 610,
    "diagnosis/verdict": 1730,
    "report": 13580,
    "report/*.py": 3200,
    "report/charts": 3210,
    "report/data": 940,
    "report/pictures": 2710,
    "report/sentences": 1530,
    "report/tables": 2130,
    "flowslide": 10260,
    "flowslide/*.py": 1810,
    "flowslide/commands": 3820,
    "flowslide/studio": 4690,
    "benchmarks": 22200,
    "benchmarks/*.py": 610,
    "benchmarks/back_analysis": 1290,
    "benchmarks/gpu": 1170,
    "benchmarks/hidden_effects": 9270,
    "benchmarks/performance": 1210,
    "benchmarks/studies": 3600,
    "benchmarks/verification": 5230,
}

MOST_FILES = 20
"""Files of a folder, `__init__.py` not counted."""
# A file for each type of measurement, effect, chart or verification case, found by its name: joined
# or moved into folders they would be harder to find. The studio has a file for each thing that its
# page asks for.
MORE_FILES = {
    "geometry/survey": 26,
    "mpm_taichi/effects": 28,
    "report/charts": 23,
    "flowslide/studio": 21,
    "benchmarks/verification": 28,
}

# Tables of data that would become one column of single numbers or names.
UNFORMATTED = {
    "geometry/scenes/drawings.py",  # units of length
    "geometry/scenes/dxf_drawings.py",  # kinds of DXF entities
    "geometry/terrain/raster.py",  # numbers that stand for no value
}

#: Words and pages of `docs`; what is made while it is built does not count.
MOST_WORDS, MOST_PAGES = 60_000, 35

FORMATTER = re.compile(r"#\s*(?:fmt|yapf):")

#: Bases of documents: a class of a file's form is called as what it describes.
DOCUMENTS = {"Document", "StrictDocument", "BaseModel"}
# The two solvers have one table of arrays each, which `state_kernel` takes alike.
TWINS = {"mpm_taichi/layout.py", "mpm_taichi/solver3d/layout.py"}


def lines_of(path: Path) -> int:
    return len(path.read_text().splitlines())


def counted() -> dict[str, int]:
    """Lines as `LINES` has them."""
    found: dict[str, int] = defaultdict(int)
    for package in PACKAGES:
        for path in (ROOT / package).rglob("*.py"):
            lines, (_, *rooms, _) = lines_of(path), path.relative_to(ROOT).parts
            found[package] += lines
            if package not in WITHOUT_ROOMS:
                found[f"{package}/{rooms[0] if rooms else '*.py'}"] += lines
    return found


def test_packages_and_rooms_keep_to_their_lines():
    found = counted()
    assert set(found) == set(LINES)
    over = {place: lines for place, lines in found.items() if lines > LINES[place]}
    assert not over


def test_folders_keep_to_their_files():
    found: dict[str, int] = defaultdict(int)
    for package in PACKAGES:
        for path in (ROOT / package).rglob("*.py"):
            found[relative(path.parent)] += path.name != "__init__.py"
    over = {folder: number for folder, number in found.items() if number > MOST_FILES}
    assert set(over) == set(MORE_FILES)
    assert all(number <= MORE_FILES[folder] for folder, number in over.items()), over


def test_the_formatter_has_no_exceptions_but_tables():
    marks = {relative(path): len(FORMATTER.findall(path.read_text())) for path in FILES}
    assert {path: number for path, number in marks.items() if number} == dict.fromkeys(
        UNFORMATTED, 1
    )


@cache
def classes() -> list[tuple[str, str, set[str]]]:
    """(file, name, names of the bases) of every class of the product."""
    return [
        (relative(path), node.name, {name for base in node.bases for name in names_in(base)})
        for path in FILES
        for node in ast.walk(tree_of(path))
        if isinstance(node, ast.ClassDef)
    ]


def names_in(base: ast.expr) -> set[str]:
    return set(re.findall(r"\w+", ast.unparse(base)))


def test_class_names_are_unique_outside_documents():
    documents = set(DOCUMENTS)
    while more := {name for _, name, bases in classes() if bases & documents} - documents:
        documents |= more
    places: dict[str, set[str]] = defaultdict(set)
    for file, name, bases in classes():
        if not bases & documents:
            places[name].add(file)
    twice = {name: files for name, files in places.items() if len(files) > 1 and files != TWINS}
    assert not twice


PAGES = sorted([*(ROOT / "docs").glob("*.md"), *(ROOT / "docs").glob("*/*.md")])


def test_the_documentation_keeps_to_its_words():
    words = sum(len(page.read_text("utf-8").split()) for page in PAGES)
    assert len(PAGES) <= MOST_PAGES and words <= MOST_WORDS, (len(PAGES), words)


def test_the_first_page_names_every_page():
    """A page is found from the README, not only by the menu of the site."""
    named = set(re.findall(r"\]\((docs/[^)#]+\.md)", (ROOT / "README.md").read_text("utf-8")))
    assert {relative(page) for page in PAGES} == named
