"""Assumptions on trial: each family changes what it says, and switches have no size."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely
from shapely.ops import unary_union

from diagnosis.case import diagnosis_case
from diagnosis.diagnose import diagnose
from diagnosis.hypotheses import section, soil, strength, water
from diagnosis.hypotheses.assumption import Assumption, with_setting
from diagnosis.hypotheses.model import Candidate, amplitude_of, switch_of
from diagnosis.hypotheses.physics import acting_candidates
from diagnosis.hypotheses.registry import FAMILIES, assumed_otherwise, assumptions_of
from diagnosis.options import Options
from geometry.case import load_case
from inversion.engines.registry import engine_named
from inversion.estimation.forward import SectionSetup
from inversion.estimation.misfit import system
from inversion.problem.question import FixedProperty
from inversion.problem.unknown import Scale, Unknown
from pipeline.cli import InputError
from tests.diagnosis.straight import signatures, straight


@pytest.fixture
def setup(embankment) -> SectionSetup:
    return diagnosis_case(load_case(embankment), spacing_m=2.0).setup


def wet(setup: SectionSetup, level: float, line: list[tuple[float, float]] | None) -> SectionSetup:
    return replace(setup, scene=setup.scene.changed(water_level=level, phreatic_line=line))


def by_name(found: list[Assumption]) -> dict[str, Assumption]:
    return {one.candidate.name: one for one in found}


def test_a_dry_section_may_have_stood_in_water(setup):
    found, left_out = water.assumptions(setup, [])
    known = by_name(found)
    sides = {"pool_on_the_left", "pool_on_the_right"}
    forms = {f"{name}_as_weight" for name in sides}
    assert set(known) == {"pool"} | sides | forms
    assert left_out["no_water"] == "the section has no water"
    assert known["pool"].candidate.ladder == pytest.approx((2.4, 4.8, 8.4))  # 12 m high
    pool = known["pool"].change(setup, 3.0).scene
    assert pool.water_level == 3.0 and pool.phreatic_line is None
    # The left slope rises 12 m in 24 m; the water table ends at the right foot.
    left = known["pool_on_the_left"].change(setup, 6.0).scene
    assert left.phreatic_line == [pytest.approx((12.0, 6.0)), (64.0, 0.0)]
    right = known["pool_on_the_right"].change(setup, 6.0).scene
    assert right.phreatic_line == [(0.0, 0.0), pytest.approx((49.0, 6.0))]
    assert left.phreatic_level(-20.0) == 6.0 and left.phreatic_level(80.0) == 0.0
    other = known["pool_on_the_left_as_weight"].change(setup, 6.0)
    assert other.settings.water == "buoyant" and other.scene.phreatic_line == left.phreatic_line
    light = water.assumptions(with_setting(setup, water="buoyant"), [])[0]
    pushing = by_name(light)["pool_on_the_right_as_pressure"]
    assert pushing.change(setup, 6.0).settings.water == "pore_pressure"


def test_a_section_with_a_pool_may_have_had_another_water(setup):
    pooled = wet(setup, 6.0, [(12.0, 6.0), (64.0, 0.0)])
    known = by_name(water.assumptions(pooled, [])[0])
    assert set(known) == {"no_water", "water_as_weight", "other_water_face", "drawdown"}
    assert all(known[name].candidate.switch for name in set(known) - {"drawdown"})
    assert not known["no_water"].change(pooled, 1.0).scene.has_water
    assert known["water_as_weight"].change(pooled, 1.0).settings.water == "buoyant"
    assert known["other_water_face"].change(pooled, 1.0).settings.water_face == "fixed"
    fallen = known["drawdown"].change(pooled, 4.0).scene
    assert fallen.water_level == 2.0
    assert fallen.phreatic_level(-5.0) == 2.0, "the pool"
    assert fallen.phreatic_level(12.0) == 6.0 and fallen.phreatic_level(38.0) == 3.0, "the soil"
    assert fallen.phreatic_level(8.0) == pytest.approx(4.0), "along the slope"
    dry = known["no_water"].change(pooled, 1.0)
    with pytest.raises(InputError, match="no pool that could have fallen"):
        known["drawdown"].change(dry, 4.0)


def test_level_water_has_no_other_form_and_stands_on_both_sides(setup):
    pooled = wet(setup, 4.0, None)
    found, left_out = water.assumptions(pooled, [])
    assert set(by_name(found)) == {"no_water", "drawdown"}
    assert "pressure and reduced weight are one" in left_out["water_as_weight"]
    fallen = by_name(found)["drawdown"].change(pooled, 1.0).scene
    assert fallen.phreatic_level(-5.0) == fallen.phreatic_level(70.0) == 3.0
    assert fallen.phreatic_level(30.0) == pytest.approx(4.0)


def test_other_soils_differ_by_what_is_stated_or_by_a_default(setup):
    known = by_name(soil.assumptions(setup, [])[0])
    # S_r of the sand and friction of the fill are calibrated.
    assert set(known) == {
        "density_of_loose_sand", "stiffness_of_loose_sand", "strength_of_compacted_fill",
        "density_of_compacted_fill", "stiffness_of_compacted_fill",
    }  # fmt: skip
    assert all(one.candidate.screened for one in known.values())
    assert known["density_of_loose_sand"].candidate.prior_std == pytest.approx(90.0)
    weak = known["strength_of_compacted_fill"]
    assert weak.candidate.ladder[0] == pytest.approx(-1.25)
    fill = weak.change(setup, -1.25).scene.materials["compacted_fill"]
    assert fill.cohesion_kpa == pytest.approx(0.75) and fill.friction_deg == 34.0
    stiff = known["stiffness_of_loose_sand"].change(setup, np.log(2.0)).scene
    assert stiff.materials["loose_sand"].youngs_modulus_mpa == pytest.approx(40.0)
    stated = FixedProperty(name="density of the fill", kind="property", zones=["fill"],
                           property="density", std=20.0)  # fmt: skip
    known = by_name(soil.assumptions(setup, [stated])[0])
    assert "density_of_compacted_fill" not in known
    assert known["density_of_the_fill"].candidate.prior_std == 20.0


def test_soil_without_friction_may_have_some_and_what_is_stated_keeps_its_name(setup):
    stated = FixedProperty(name="friction of loose sand", kind="property", zones=["sand"],
                           property="friction_deg", std=3.0)  # fmt: skip
    candidate = by_name(soil.assumptions(setup, [stated])[0])["friction_of_loose_sand"].candidate
    assert candidate.ladder == (1.5, 3.0, 7.5), "no soil has less than none"
    assert candidate.low == 0.0 and candidate.prior_mean == 0.0, "it may be as it was assumed"
    again = stated.model_copy(update={"std": 9.0})
    twice = by_name(soil.assumptions(setup, [stated, again])[0])["friction_of_loose_sand"]
    assert twice.candidate.prior_std == 3.0, "what comes first keeps its name"


def test_parts_of_the_liquefied_soil_hold_a_third_of_it_each(setup):
    x, y = strength.thirds(setup.scene)
    zones = unary_union([shapely.Polygon(z.polygon) for z in setup.scene.zones if z.name == "sand"])
    for spans, vertical in ((x, True), (y, False)):
        for low, high in spans:
            box = shapely.box(low, -9.0, high, 99.0) if vertical else shapely.box(
                -99.0, low, 999.0, high)  # fmt: skip
            assert zones.intersection(box).area == pytest.approx(zones.area / 3, rel=0.05)
    known = by_name(strength.assumptions(setup, [])[0])
    assert len(known) == 15
    block = known["lower_left_block"]
    entry = block.change(setup, 0.4).scene.effects["strength_contrast"]
    assert entry["amplitude"] == 0.4 and entry["x_m"] < 22.0 and entry["y_m"] < 2.5
    with pytest.raises(InputError, match="another part has its own strength"):
        known["upper_layer"].change(block.change(setup, 0.4), 0.2)


def test_the_top_of_the_liquefied_soil_is_on_trial_where_no_boundary_is_stated(setup):
    top = section.top_of_liquefied_soil(setup.scene)
    height = setup.scene.extent[1]
    assert {vertex.move for vertex in top.vertices} == {(0.0, round(0.08 * height, 3))}
    (one,) = section.assumptions(setup, [])[0]
    assert one.candidate.name == "boundary_top_of_the_liquefied_soil"
    raised = one.change(setup, 1.0).scene

    def area(scene):
        return sum(shapely.Polygon(z.polygon).area for z in scene.zones if z.name == "sand")

    assert area(raised) > area(setup.scene) + 1.0
    total = [sum(shapely.Polygon(z.polygon).area for z in s.zones) for s in (raised, setup.scene)]
    assert total[0] == pytest.approx(total[1]), "what one zone gains the other loses"
    stated = top.model_copy(update={"name": "roof"})
    names = [one.candidate.name for one in section.assumptions(setup, [stated])[0]]
    assert names == ["boundary_roof"], "what is stated stands in its place"


def test_an_engine_without_effects_knows_the_section_alone(setup):
    blind = replace(engine_named("mpm"), effects=False)
    found, left_out = assumptions_of(setup, [], blind)
    assert {one.candidate.family for one in found} == {"section"}
    assert "knows no other" in left_out["pool"]
    families = {one.candidate.family for one in assumptions_of(setup, [], engine_named("mpm"))[0]}
    assert families >= {"water", "soil", "strength"} and len(FAMILIES) >= 4


def test_a_hypothesis_may_doubt_an_assumption(setup):
    changed = assumed_otherwise(setup, [], {"pool": 3.0, "datum_shift": 0.2}, "02_pool.yaml")
    assert changed.scene.water_level == 3.0
    lower = setup.targets.measured - changed.targets.measured
    assert set(np.round(lower, 9)) == {0.0, 0.2}
    with pytest.raises(InputError, match=r"02_pool.yaml: effects: no effect 'pond'"):
        assumed_otherwise(setup, [], {"pond": 3.0}, "02_pool.yaml")
    with pytest.raises(
        InputError, match=r"effects: pool: 99 m: from 0 to \d+(\.\d+)? m is allowed"
    ):
        assumed_otherwise(setup, [], {"pool": 99.0}, "02_pool.yaml")
    with pytest.raises(InputError, match=r"effects: bonded_base: 0.3: 0 \(off\) or 1 \(on\)"):
        assumed_otherwise(setup, [], {"bonded_base": 0.3}, "02_base.yaml")
    off, on = (
        assumed_otherwise(setup, [], {"bonded_base": size}, "02_base.yaml").scene.ground
        for size in (0.0, 1.0)
    )
    assert off == setup.scene.ground != on


def test_of_two_assumptions_that_set_the_same_thing_one_is_refused(setup):
    two = {"bonded_base": 1.0, "base_of_friction": 0.6}
    with pytest.raises(InputError, match="effects: bonded_base: does nothing beside base_of_fric"):
        assumed_otherwise(setup, [], two, "02_base.yaml")
    apart = assumed_otherwise(setup, [], {"bonded_base": 1.0, "pool": 3.0}, "02_both.yaml").scene
    assert apart.water_level == 3.0 and apart.ground.contact == "no_slip"


def switched(seed: int, effects: dict[str, float]):
    """The straight model whose bend is on or off."""
    model = straight(seed, effects)
    model.candidates = [
        switch_of("bend", "water", "the bend is there") if one.name == "bend" else one
        for one in model.candidates
        if one.name != "like_bend"
    ]
    return model


def test_a_switch_that_is_on_is_found_and_has_no_error():
    found = diagnose(switched(3, {"bend": 1.0}), Options(draws=400, replicates=3, seed=3))
    fit = found.decision.final.model.fit
    assert found.decision.verdict == "identified" and fit.names == ("bend",)
    assert fit.space.amplitudes(fit.x) == {"bend": 1.0}
    base = found.comparison.adequacy
    assert found.decision.final.adequacy.dof == base.dof, "a switch is not fitted"


def test_a_switch_that_would_overshoot_stays_off():
    """A third of the bend: switching it on would make the misfit worse."""
    model = switched(3, {"bend": 0.33})
    found = diagnose(model, Options(draws=400, replicates=3, seed=3))
    assert "bend" not in found.decision.final.model.names
    score = found.explanation.scores.best("bend")
    assert score.amplitude in (0.0, 1.0) and score.drop >= 0.0


def test_a_switch_needs_no_prior_volume():
    amplitude = amplitude_of(switch_of("bend", "water", "the bend is there"))
    assert amplitude.held and amplitude.ln_prior_width == 0.0


def test_what_is_screened_out_costs_one_run():
    """Candidates that promise nothing are run once, and both their signs count for p."""

    def costs(screened: bool) -> tuple[int, dict]:
        model = straight(1, {})
        model.candidates = [replace(one, screened=screened) for one in model.candidates]
        found = diagnose(model, Options(draws=400, replicates=3, seed=1))
        return model.runs, found.explanation.signatures

    few, screened = costs(True)
    many, _ = costs(False)
    assert few < many
    quiet = [one for one in screened.values() if len(one.changes) == 2]
    assert quiet, "something promises nothing"
    for one in quiet:
        first, second = one.amplitudes
        assert first == -second and np.array_equal(one.changes[first], -one.changes[second])


def test_what_is_assumed_widens_a_strength_as_an_unknown_with_that_prior_would():
    case = straight(2, {})
    change = signatures()["late"]
    plain, doubted = (
        case.space([]),
        case.space([Unknown("late", -9.0, 9.0, Scale(), (0.0, 0.7))]),
    )
    x = plain.parameters.to_fitted(plain.parameters.start)
    narrow = system(case.data, plain, case.slope(plain), x)
    wide = narrow.with_assumed([0.7 * change])
    joint = system(case.data, doubted, case.slope(doubted), np.append(x, 0.0))
    assert np.allclose(wide.posterior[:2, :2], joint.posterior[:2, :2])
    assert wide.posterior[0, 0] > 1.01 * narrow.posterior[0, 0]
    assert narrow.with_assumed([]) is narrow


def test_an_effect_that_outlasts_the_run_is_tried_as_far_as_it_ends(setup):
    known = {"late_liquefaction": {}}
    found, left_out = acting_candidates(setup.scene, known, duration=20.0)
    late = next(one for one in found if one.name == "late_liquefaction")
    assert late.ladder == (5.0, 15.0) and late.high == pytest.approx(16.0)
    found, left_out = acting_candidates(setup.scene, known, duration=5.0)
    assert left_out["late_liquefaction"] == "it goes on for longer than the run of 5 s"


def test_every_candidate_has_a_family_and_a_ladder_within_its_bounds(setup):
    for one in assumptions_of(setup, [], engine_named("mpm"))[0]:
        candidate: Candidate = one.candidate
        assert candidate.low <= min(candidate.ladder) and max(candidate.ladder) <= candidate.high
        assert 0.0 not in candidate.ladder and candidate.words
