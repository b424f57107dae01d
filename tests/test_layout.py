"""The rules of the house: who may import whom, and that the packages imported are ours."""

from __future__ import annotations

import ast
import importlib
import math
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.sparse.csgraph import connected_components

ROOT = Path(__file__).resolve().parent.parent

# A package imports only from packages to its left, and from `pipeline`.
ORDER = ["geometry", "mpm_taichi", "gns", "inversion", "diagnosis", "report", "flowslide"]
ALLOWED = {"pipeline": set()} | {
    name: {"pipeline", *ORDER[:position]} for position, name in enumerate(ORDER)
}
# The rooms of a package; a room imports only from rooms to its left, in functions and for types as
# well.
ROOMS = {
    "geometry": [
        "terrain", "scenes", "scenes3d", "random_scenes", "dimensions", "survey", "survey3d",
    ],
    "mpm_taichi": ["materials", "effects", "solver", "solver3d"],
    "gns": ["data", "network", "rollout", "evaluation", "training", "direct"],
    "inversion": [
        "catalogue", "problem", "estimation", "engines", "classical", "back_analysis",
        "posterior", "joint", "prediction", "new_case",
    ],
    "diagnosis": ["hypotheses", "adequacy", "signatures", "selection", "verdict"],
    "report": ["data", "sentences", "tables", "pictures", "charts"],
    "flowslide": ["studio", "commands"],
}  # fmt: skip
IMPORT = ast.Import | ast.ImportFrom
# The hooks of effects are compiled into the step and use one of its functions; pore water flows on
# the grid of the solver.
JOINTS = {
    ("mpm_taichi/effects/framework/hooks.py", "mpm_taichi/solver/transfer.py"),
    ("mpm_taichi/effects/pore_water.py", "mpm_taichi/solver/pore_water.py"),
}
PRESENT = [name for name in ALLOWED if (ROOT / name / "__init__.py").exists()]
FILES = [path for name in PRESENT for path in sorted((ROOT / name).rglob("*.py"))]


@cache
def tree_of(path: Path) -> ast.Module:
    return ast.parse(path.read_text())


def imports(tree: ast.AST, *, package: str = "") -> Iterator[tuple[str, ast.stmt]]:
    """Full names of the modules that a file imports, wherever in the file."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield alias.name, node
        elif isinstance(node, ast.ImportFrom):
            yield (package if node.level else node.module or ""), node


def imports_when_loaded(body: list[ast.stmt]) -> Iterator[str]:
    """Modules imported by merely importing the file: not those in functions or type checks."""
    for node in body:
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and not node.level:
            yield node.module or ""
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test):
            yield from imports_when_loaded(node.orelse)
        elif not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            for field in ("body", "orelse", "finalbody"):
                yield from imports_when_loaded(getattr(node, field, []))
            for handler in getattr(node, "handlers", []):
                yield from imports_when_loaded(handler.body)


def imports_anywhere(tree: ast.AST) -> Iterator[str]:
    """Modules imported in functions and for types alone too."""
    for node in ast.walk(tree):
        if isinstance(node, IMPORT):
            yield from imports_when_loaded([node])


def top(module: str) -> str:
    return module.partition(".")[0]


def relative(path: Path) -> str:
    return str(path.relative_to(ROOT))


def module_file(module: str) -> Path | None:
    """The file of one of our modules, or None if it is not one of our modules."""
    if top(module) not in PRESENT:
        return None
    stem = ROOT.joinpath(*module.split("."))
    for candidate in (stem / "__init__.py", stem.with_suffix(".py")):
        if candidate.exists():
            return candidate
    return None


def loaded_with(path: Path, seen: set[Path] | None = None) -> set[str]:
    """Every top-level module that is loaded when `path` is imported, followed through our files."""
    seen = set() if seen is None else seen
    if path in seen:
        return set()
    seen.add(path)
    found: set[str] = set()
    for module in imports_when_loaded(tree_of(path).body):
        found.add(top(module))
        parts = module.split(".")
        for length in range(1, len(parts) + 1):
            ours = module_file(".".join(parts[:length]))
            if ours is not None:
                found |= loaded_with(ours, seen)
    return found


@pytest.mark.parametrize("path", FILES, ids=relative)
def test_imports_go_to_the_left(path):
    package = path.relative_to(ROOT).parts[0]
    for module, node in imports(tree_of(path), package=package):
        if top(module) in ALLOWED and top(module) != package:
            assert top(module) in ALLOWED[package], (
                f"{relative(path)}:{node.lineno}: {package} may not import {module}"
            )


@pytest.mark.parametrize("path", FILES, ids=relative)
def test_rooms_import_only_rooms_to_their_left(path):
    """Files at the top of a package are in no room: they join the rooms, or serve all of them."""
    package, *rest = path.relative_to(ROOT).parts[:-1]
    if not rest:
        return
    rooms = ROOMS[package]
    for module in imports_anywhere(tree_of(path)):
        ours = module_file(module)
        parts = ours.relative_to(ROOT).parts if ours else ()
        if len(parts) < 3 or parts[0] != package or parts[1] == rest[0]:
            continue
        if (relative(path), "/".join(parts)) in JOINTS:
            continue
        assert rooms.index(parts[1]) < rooms.index(rest[0]), (
            f"{relative(path)}: {package}/{rest[0]} may not import {module}"
        )


# A form and what checks it, a thing and what is made of it: two files that are read as one.
READ_AS_ONE = [
    {"geometry/survey/measured.py", "geometry/survey/site.py"},
    {"inversion/back_analysis/result.py", "inversion/back_analysis/result_checks.py"},
    {"mpm_taichi/effects/__init__.py", "mpm_taichi/effects/framework/registry.py"},
]


def test_nothing_is_read_in_circles():
    """Counting imports in functions and for types alone, which hide a circle from Python only."""
    place = {path: number for number, path in enumerate(FILES)}
    reads = np.zeros((len(FILES), len(FILES)))
    for path in FILES:
        for module in imports_anywhere(tree_of(path)):
            if (other := module_file(module)) in place:
                reads[place[path], place[other]] = 1.0
    count, circle = connected_components(reads, connection="strong")
    found = [{relative(FILES[n]) for n in np.flatnonzero(circle == k)} for k in range(count)]
    circles = [files for files in found if len(files) > 1]
    assert sorted(circles, key=sorted) == READ_AS_ONE


def test_every_room_has_its_place():
    for package, rooms in ROOMS.items():
        folders = {path.parent.name for path in (ROOT / package).glob("*/__init__.py")}
        assert folders == set(rooms), package


@pytest.mark.parametrize("path", FILES, ids=relative)
def test_taichi_and_torch_are_imported_where_they_belong(path):
    package = path.relative_to(ROOT).parts[0]
    for module, node in imports(tree_of(path)):
        place = f"{relative(path)}:{node.lineno}"
        if top(module) == "taichi":
            assert package == "mpm_taichi", f"{place}: taichi belongs to mpm_taichi"
        if top(module) == "torch":
            guest = relative(path).startswith(("inversion/engines/gns_", "flowslide/commands/gns_"))
            assert package == "gns" or guest, (
                f"{place}: torch belongs to gns, its engine and commands"
            )


@pytest.mark.parametrize("path", FILES, ids=relative)
def test_only_reports_draw(path):
    for module, node in imports(tree_of(path)):
        if top(module) == "matplotlib":
            place = f"{relative(path)}:{node.lineno}: drawing belongs to report"
            assert path.relative_to(ROOT).parts[0] == "report", place


#: Most words of a label: of what is fitted, of a stage, of a run that was left out.
LABEL = 7
#: What states reasons and candidates in words, as labels of the documents: longer, but no sentence.
LONG_LABELS = "diagnosis/hypotheses/"
#: Calls whose words are no finding: descriptions of a document's keys, errors, progress.
OTHER_WORDS = {"Field", "InputError", "WorkFailed", "say"}


def told(node: ast.AST) -> Iterator[tuple[str, int]]:
    """Texts with their lines, a placeholder as `{}`; not docstrings, errors, progress, `Field`s."""
    if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
        return
    if isinstance(node, ast.Call):
        name = getattr(node.func, "id", getattr(node.func, "attr", ""))
        if name in OTHER_WORDS:
            return
    if isinstance(node, ast.Constant | ast.JoinedStr):
        parts = node.values if isinstance(node, ast.JoinedStr) else [node]
        texts = [part.value if isinstance(part, ast.Constant) else "{}" for part in parts]
        yield "".join(map(str, texts)), node.lineno
        parts = [part for part in parts if isinstance(part, ast.FormattedValue)]
    else:
        parts = [] if isinstance(node, ast.Raise) else list(ast.iter_child_nodes(node))
    for part in parts:
        yield from told(part)


def is_sentence(text: str, most: float = LABEL) -> bool:
    """Several words with a full stop, or more than a label has; not the comment of a file."""
    count, stopped = len(text.split()), ". " in f"{text.rstrip()} "
    return not text.startswith("#") and (count > most or (stopped and count > 3))


@pytest.mark.parametrize(
    "path", [path for path in FILES if relative(path).startswith("diagnosis/")], ids=relative
)
def test_a_diagnosis_writes_no_sentences(path):
    """Its documents hold numbers and keys: `report/sentences` has the one wording of each."""
    most = math.inf if relative(path).startswith(LONG_LABELS) else LABEL
    found = [f"{line}: {text}" for text, line in told(tree_of(path)) if is_sentence(text, most)]
    assert found == [], relative(path)


def test_what_a_sentence_is():
    tree = ast.parse(
        '"""It says. What it does."""\n'
        'raise ValueError(f"{path}: that is not what a model may be.")\n'
        'say(f"{name}: chi2 falls from far above to {chi2} at last")\n'
        'a = "the code that made the slide"\n'
        'b = f"Only {name} explains {what}."\n'
        'c = [f"{a} falls by {b:.1f} only; " f"{c:g} are asked for"]\n'
    )
    assert [line for text, line in told(tree) if is_sentence(text)] == [5, 6]


def test_the_text_of_a_report_needs_no_drawing():
    for name in ("numbers", "table", "page", "tables/back_analysis", "sentences/diagnosis"):
        assert "matplotlib" not in loaded_with(ROOT / "report" / f"{name}.py"), name
    for composer in ("back_analysis", "diagnosis"):
        assert "matplotlib" not in loaded_with(ROOT / "report" / f"{composer}.py"), composer


@pytest.mark.parametrize("package", PRESENT)
@pytest.mark.parametrize("name", ["__init__.py", "__main__.py"])
def test_no_heavy_import_before_it_is_needed(package, name):
    path = ROOT / package / name
    if not path.exists():
        pytest.skip("no such file")
    assert not loaded_with(path) & {"taichi", "torch"}


@pytest.mark.parametrize("package", PRESENT)
def test_package_is_ours(package):
    # Public packages named `gns` and `inversion` exist; none of them may be taken for ours.
    module = importlib.import_module(package)
    assert Path(module.__file__).resolve().is_relative_to(ROOT)


def test_packages_are_ours_from_anywhere(tmp_path):
    script = "\n".join(f"import {name}; print({name}.__file__)" for name in PRESENT)
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    for line in done.stdout.splitlines():
        assert Path(line).resolve().is_relative_to(ROOT), line


def test_packages_are_found():
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text())
    patterns = settings["tool"]["setuptools"]["packages"]["find"]["include"]
    assert sorted(patterns) == sorted(f"{name}*" for name in PRESENT)
    for name in PRESENT:
        for folder in {path.parent for path in (ROOT / name).rglob("*.py")}:
            assert (folder / "__init__.py").exists(), f"{relative(folder)} is not a package"


@pytest.mark.parametrize("package", PRESENT)
def test_package_says_what_it_is_for(package):
    text = ast.get_docstring(ast.parse((ROOT / package / "__init__.py").read_text()))
    assert text and "In:" in text and "Out:" in text


def unexplained_numbers(text: str) -> list[str]:
    """Constants of a module with a number in them, and neither a comment nor a docstring at it.

    Whether the words are a reason is for a reader.
    """
    lines, body = text.splitlines(), ast.parse(text).body
    found = []
    for node, after in zip(body, [*body[1:], None], strict=True):
        if not isinstance(node, ast.Assign | ast.AnnAssign):
            continue
        targets = node.targets if isinstance(node, ast.Assign) else [node.target]
        names = [
            one.id for target in targets for one in ast.walk(target) if isinstance(one, ast.Name)
        ]
        values = [one.value for one in ast.walk(node) if isinstance(one, ast.Constant)]
        numbers = [one for one in values if type(one) in (int, float)]
        above, own = lines[node.lineno - 2], lines[node.lineno - 1 : node.end_lineno]
        commented = above.startswith("#") or any("  # " in line for line in own)
        below = isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant)
        if numbers and all(name.isupper() for name in names) and not (commented or below):
            found += names
    return found


DECIDING = [
    path for path in FILES if relative(path).startswith(("diagnosis/", "inversion/estimation/"))
]


@pytest.mark.parametrize("path", DECIDING, ids=relative)
def test_numbers_that_decide_a_verdict_say_why(path):
    assert not unexplained_numbers(path.read_text())


def test_a_number_without_a_reason_is_seen():
    assert unexplained_numbers("#: Why.\nA = 1\nB, C = 2, (3.0, 4)\nD = 5  # why\n") == ["B", "C"]
    assert unexplained_numbers('E = {"x": 1}\n"""Why."""\nF = "x"\nG: int = 6\n') == ["G"]
