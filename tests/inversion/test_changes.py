"""Variants and sensitivities: what of the setup changes, and what stays."""

from __future__ import annotations

from dataclasses import replace

import pytest

from geometry.case import load_case
from geometry.scenes.polygon_checks import gaps
from geometry.survey.marker_displacement import MarkerDisplacement
from inversion.back_analysis.case import inversion_case
from inversion.back_analysis.variants import sides
from inversion.estimation.data import make_targets
from inversion.problem.question import (
    CellSize,
    FixedProperty,
    OtherSetting,
    Target,
    TimeStep,
    Variant,
    WaterLevel,
    ZoneBoundary,
)
from pipeline.cli import InputError
from tests.dams import dam_with_pool
from tests.inversion.analytic import toes


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    return inversion_case(load_case(dam_with_pool(tmp_path_factory.mktemp("case") / "dam")))


def sides_of(case, entry):
    return sides(case.setup, entry, case.source)


def area(scene, name: str) -> float:
    ring = next(zone.polygon for zone in scene.zones if zone.name == name)
    pairs = zip(ring, [*ring[1:], ring[0]], strict=True)
    return 0.5 * abs(sum(a[0] * b[1] - b[0] * a[1] for a, b in pairs))


def test_a_boundary_moves_in_every_zone_that_has_it(case):
    entry = ZoneBoundary(
        name="top", kind="zone_boundary",
        vertices=[{"at": (126.54, 18.5), "move": (15.24, 6.0)},
                  {"at": (176.75, 18.5), "move": (2.93, 6.0)}],
    )  # fmt: skip
    higher, lower = sides_of(case, entry)
    before, after = case.setup.scene, higher.setup.scene
    assert area(after, "1") > area(before, "1") > area(lower.setup.scene, "1")
    assert area(after, "1") + area(after, "2") == pytest.approx(
        area(before, "1") + area(before, "2"), rel=2e-3
    )
    assert not gaps({zone.name: zone.polygon for zone in after.zones}, 1.0)
    assert "+6" in higher.words and "-6" in lower.words
    assert higher.setup.foot == case.setup.foot


def test_the_base_moves_with_the_soil_on_it(case):
    scene = case.setup.scene
    low = {place for zone in scene.zones for place in zone.polygon if place[1] == 2.0}
    vertices = [{"at": at, "move": (0.0, 1.5)} for at in [*scene.ground.points, *sorted(low)]]
    higher, lower = sides_of(
        case, ZoneBoundary(name="base", kind="zone_boundary", vertices=vertices)
    )
    for changed, level in ((higher, 3.5), (lower, 0.5)):
        moved = changed.setup.scene
        assert moved.ground.points == [(0.0, level), (390.0, level)]
        assert moved.extent == (level, scene.extent[1])
        assert not gaps({zone.name: zone.polygon for zone in moved.zones}, 1.0)


def test_a_moved_foot_moves_the_zero_of_the_runout(case):
    vertices = [{"at": (76.02, 2.0), "move": (-5.0, 0.0)}]
    entry = ZoneBoundary(name="foot", kind="zone_boundary", vertices=vertices, sides="plus")
    (moved,) = sides_of(case, entry)
    assert moved.setup.foot["left"] == pytest.approx(case.setup.foot["left"] - 5)
    assert moved.setup.foot["right"] == case.setup.foot["right"]


def test_the_pool_takes_the_phreatic_line_with_it_where_it_stands_at_pool_level(case):
    higher, lower = sides_of(case, WaterLevel(name="pool", kind="water_level", std_m=0.5))
    assert higher.setup.scene.water_level == pytest.approx(36.4)
    line = higher.setup.scene.phreatic_line
    assert line[0][1] == pytest.approx(36.4)
    assert line[-1] == case.setup.scene.phreatic_line[-1], "behind the core nothing changes"
    assert lower.setup.scene.water_level == pytest.approx(35.4)


def test_numerical_choices(case):
    (coarse,) = sides_of(case, CellSize(name="c", kind="cell_size", factor=2.0))
    assert coarse.setup.scene.spacing == 2.0
    (shorter,) = sides_of(case, TimeStep(name="t", kind="time_step", factor=0.5))
    assert shorter.setup.settings.courant == pytest.approx(0.5 * case.setup.settings.courant)
    (flip,) = sides_of(
        case, OtherSetting(name="f", kind="simulation", simulation={"transfer": "flip"})
    )
    assert flip.setup.settings.transfer == "flip"
    assert flip.setup.scene == case.setup.scene


def test_a_property_that_is_not_sought(case):
    entry = FixedProperty(
        name="core", kind="property", zones=["3"], property="cohesion_kpa", std=7.5
    )
    up, down = sides_of(case, entry)
    for changed, expected in ((up, 37.5), (down, 22.5)):
        scene = changed.setup.scene
        zone = next(zone for zone in scene.zones if zone.name == "3")
        assert scene.materials[zone.material].cohesion_kpa == expected
    _, weaker = sides_of(case, entry.model_copy(update={"std": 40.0}))
    zone = next(zone for zone in weaker.setup.scene.zones if zone.name == "3")
    assert weaker.setup.scene.materials[zone.material].cohesion_kpa == 0.0
    assert weaker.words == "cohesion_kpa -40 in zones 3, but not below 0"
    steep = entry.model_copy(update={"property": "density", "std": 4000.0})
    with pytest.raises(
        InputError, match=r"core: density -4000: .*density.* greater than 0"
    ) as told:
        sides_of(case, steep)
    assert "pydantic" not in str(told.value)
    sought = entry.model_copy(update={"zones": ["1"]})
    with pytest.raises(InputError, match="is calibrated by 'residual_strength_1'"):
        sides_of(case, sought)


def test_the_ends_of_a_stated_range(case):
    high, low = sides_of(case, Target(name="range", kind="target", measurement="upstream toe"))
    mask = case.setup.targets.fitted
    assert high.setup.targets.measured[mask] == pytest.approx([65.0])
    assert low.setup.targets.measured[mask] == pytest.approx([42.0])
    with pytest.raises(InputError, match="'crest' is not fitted; fitted are upstream toe"):
        sides_of(case, Target(name="range", kind="target", measurement="crest"))


def test_variants(case):
    dry = case.variant(Variant(name="dry", water="none")).setup
    assert dry.scene.water_level is None and dry.settings == case.setup.settings
    pressure = case.variant(Variant(name="p", water="pore_pressure")).setup
    assert pressure.settings.water == "pore_pressure" and pressure.scene == case.setup.scene
    bonded = case.variant(Variant(name="b", contact="no_slip")).setup
    assert bonded.scene.ground.contact == "no_slip"
    farther = case.variant(Variant(name="f", targets={"upstream toe": 65.0})).setup
    assert farther.targets.named(farther.targets.measured, farther.targets.fitted) == {
        "upstream toe": 65.0
    }


def test_another_set_of_measurements(root):
    case = inversion_case(load_case(root / "case_histories" / "la_marquesa"))
    other = case.variant(Variant(name="paper", measurements="paper")).setup
    assert case.setup.targets.measured[case.setup.targets.fitted] == pytest.approx([11.0, 6.5])
    assert other.targets.measured[other.targets.fitted] == pytest.approx([2.5, 10.0])
    same = inversion_case(load_case(case.folder), measurement_set="paper")
    assert same.setup.targets.names == other.targets.names
    one = replace(case, question=case.question.model_copy(update={"fit": ["upstream toe"]}))
    other = one.variant(Variant(name="paper", measurements="paper")).setup
    assert other.targets.measured[other.targets.fitted] == pytest.approx([2.5])
    with pytest.raises(InputError, match="no set of measurements 'guess'"):
        case.variant(Variant(name="guess", measurements="guess"))


def test_numbers_of_two_measurements_have_names_of_their_own():
    (toe,) = toes(53.0)
    marker = MarkerDisplacement(
        type="marker_displacement", name="m", x_m=1, y_m=1, dx_m=2, dy_m=3, std_m=1,
        confidence="paper", source="test",
    )  # fmt: skip
    two = [toe.model_copy(update={"name": "m dx"}), marker]
    with pytest.raises(InputError, match="test: two measured numbers would be called 'm dx'"):
        make_targets(two, fit=None, loss="misfit", source="test")


def test_roles(case):
    roles = dict(zip(case.setup.targets.names, case.setup.targets.roles, strict=True))
    assert roles["upstream toe"] == "fitted"
    assert roles["crest"] == "compared"
    assert {role for name, role in roles.items() if name.startswith("profile")} == {"constructed"}
    fitted = case.setup.targets.named(case.setup.targets.measured, case.setup.targets.fitted)
    assert fitted == {"upstream toe": 53.0}


def test_jittered_setups_differ_in_nothing_but_their_points(case):
    one, two = (case.jittered(case.setup, seed).scene for seed in (1, 2))
    assert one != two
    assert one.changed(seed=2) == two
    assert one.changed(seed=0, jitter=0.0) == case.setup.scene
