"""The registry of types: a type that forgets something is refused when it is registered."""

from __future__ import annotations

import ast
from pathlib import Path

import numpy as np
import pytest

from geometry.scenes.fill import fill
from geometry.survey import registry
from geometry.survey.measured import REQUIRED, Deposit
from geometry.survey.measurements import Measurements, check_places
from geometry.survey.registry import load_measurements_code, measurement_of, measurement_types
from geometry.survey.site import Site
from pipeline.cli import InputError

ROOT = Path(__file__).resolve().parents[2]
EXAMPLE = ROOT / "docs" / "examples" / "my_measurement.py"
PACKAGES = ("geometry", "mpm_taichi", "gns", "inversion", "diagnosis", "report", "flowslide",
            "benchmarks")  # fmt: skip
CENTROID = {"name": "centroid", "type": "centroid_travel", "value_m": -3.0, "std_m": 0.5,
            "confidence": "assumed", "source": "a test"}  # fmt: skip

#: Every member that a type must give, as the example has it.
MEMBERS = {
    "history": "    history: ClassVar[None] = None  # the last frame is enough\n",
    "along": "    along: ClassVar[None] = None  # a single number that has no place\n",
    "datum": "    datum: ClassVar[None] = None  # horizontal: no levelling error enters it\n",
    "read_points": "    def read_points(",
    "check_in": "    def check_in(",
    "could_be_made": "    def could_be_made(",
    "marks": "    def marks(",
}


@pytest.fixture(autouse=True)
def users():
    """No types of users before, and none left behind."""
    registry._users.clear()
    yield registry._users
    registry._users.clear()


def written(tmp_path: Path, *changes: tuple[str, str]) -> Path:
    """The example, changed."""
    text = EXAMPLE.read_text()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    path = tmp_path / "mine.py"
    path.write_text(text)
    return path


@pytest.mark.parametrize("name", MEMBERS)
def test_a_type_that_forgets_a_member_is_refused_at_once(name, tmp_path, users):
    line = MEMBERS[name]
    other = line.replace(name, f"other_{name}")
    with pytest.raises(InputError, match=f"mine.py: CentroidTravel: lacks {name}$"):
        load_measurements_code(written(tmp_path, (line, other)))
    assert not users


def test_a_type_on_the_bare_base_must_say_everything(tmp_path):
    path = tmp_path / "bare.py"
    path.write_text(
        "from typing import Literal\n"
        "from geometry.survey.measured import Measured\n"
        'class Bare(Measured):\n    type: Literal["bare"]\n'
    )
    with pytest.raises(InputError) as caught:
        load_measurements_code(path)
    assert str(caught.value).endswith(f"Bare: lacks {', '.join(REQUIRED)}")


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (('    type: Literal["centroid_travel"]', "    kind: str"), 'needs a field `type: '),
        (('Literal["centroid_travel"]', 'Literal["freeboard"]'), "the library has a meas"),
        (("ClassVar[None] = None  # the last", 'ClassVar = ("at_s",)  # the last'),
         "CentroidTravel: history names no field at_s"),
        (("class CentroidTravel(SingleLength)", "class CentroidTravel"), "defines no type of"),
        (("import numpy as np", "import nothing_of_that_name"), "does not load: Mod"),
    ],
)  # fmt: skip
def test_files_that_are_no_types_are_refused(change, complaint, tmp_path, users):
    with pytest.raises(InputError, match="mine.py: ") as caught:
        load_measurements_code(written(tmp_path, change))
    assert complaint in str(caught.value) and "\n" not in str(caught.value)
    assert not users


def test_the_library_is_whole():
    types = measurement_types()
    assert len(types) == len(registry.LIBRARY)
    for name, kind in types.items():
        assert name == kind.__module__.rpartition(".")[2], "one file per type, of its name"


@pytest.mark.parametrize("package", PACKAGES)
def test_nobody_else_asks_for_the_type_of_a_measurement(package):
    """What differs from type to type is a member of the type, so that a new one is one file."""
    names = {kind.__name__ for kind in registry.LIBRARY} | {"Length", "Single", "SingleLength"}
    for path in sorted((ROOT / package).rglob("*.py")):
        if path.parent == ROOT / "geometry" / "survey":
            continue
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "isinstance":
                asked = {part.id for part in ast.walk(node.args[1]) if isinstance(part, ast.Name)}
                assert not asked & names, f"{path}:{node.lineno}"


def test_a_users_type_is_read_checked_and_proposed(make_scene):
    (kind,) = load_measurements_code(EXAMPLE)
    entry = measurement_of(CENTROID)
    assert type(entry) is kind and entry.values == [-3.0]
    section = make_scene([[(0.0, 2.0), (12.0, 10.0), (18.0, 10.0), (30.0, 2.0)]],
                         ground=[[-100.0, 2.0], [100.0, 2.0]], spacing=0.5)  # fmt: skip
    before = fill(section).position
    after = before - [2.0, 0.0] * (before[:, :1] > 15.0)
    deposit = Deposit(after, before, 0.25, 0.5, {"left": 0.0, "right": 30.0})
    assert entry.observe(deposit) == pytest.approx([-2.0 * np.mean(before[:, 0] > 15.0)])
    change = entry.observe_with_derivative(deposit).change
    assert change.shape == (1, 1, *before.shape)
    assert change[0, 0, :, 0].sum() == pytest.approx(1.0)
    site = Site(section, {"left": 0.0, "right": 30.0}, [], 9.81)
    (proposed,) = kind.could_be_made(site)
    assert proposed.std == 0.3 and not kind.could_be_made(Site(section, site.feet, [entry], 9.81))
    document = {"case": "test", "upstream": "left", "initial": {}, "default_set": "field"}
    far = Measurements.model_validate(
        {**document, "sets": {"field": [{**CENTROID, "value_m": 3000.0}]}}
    )
    with pytest.raises(InputError, match="'centroid': value_m 3000: the domain is only"):
        check_places(far, section, "m.yaml")


def test_a_changed_file_replaces_its_type_and_renames_what_is_kept_of_runs(tmp_path):
    (first,) = load_measurements_code(EXAMPLE)
    (again,) = load_measurements_code(EXAMPLE)
    assert first is again
    kept = ("ClassVar[None] = None  # the last", "ClassVar = ()  # the last")
    keys = []
    for words in ("Mean displacement", "The mean displacement"):
        path = written(tmp_path, kept, ("Mean displacement", words))
        load_measurements_code(path)
        entry = measurement_of(CENTROID)
        assert entry.needs_history
        keys.append(entry.reading_key({"left": 0.0, "right": 1.0}))
    assert keys[0] != keys[1]
