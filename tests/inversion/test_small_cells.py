"""Strengths in small cells: on formulas whose cells cost a known share, and on a small slide."""

from __future__ import annotations

from copy import copy
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from flowslide import back_analyse
from geometry.scenes.drawings import read_section, section_scene
from geometry.scenes.fill import point_count
from inversion.engines.small_cells import (
    FARTHEST,
    MOST_LOG,
    NOISE_STD,
    ORDER,
    SHARE_STD,
    UNKNOWN_STD,
    InSmallCells,
    SmallCells,
    other_spacings,
    same_slide,
    small_cells,
)
from inversion.estimation.forward import SectionSetup
from inversion.estimation.unknowns import Parameters
from inversion.new_case.make_case import Given, make_case
from pipeline.config import SimulationSettings
from tests.inversion.analytic import Formula, angle, strength, targets

DRAWINGS = Path(__file__).parents[2] / "docs/examples/gallery"
PARAMETERS = Parameters([strength("a"), angle("b")])
VALUES = np.array([20.0, 31.0])


def cells_of(spacing: float, cost: float = 0.04, noise: float = 0.0, toe=None) -> Formula:
    """Two toes of runs whose strength is too low by `cost` times spacing^1.45."""
    loss = np.exp(cost * spacing**ORDER)

    def toes(values: np.ndarray) -> np.ndarray:
        true = values[0] * loss
        first = 50.0 - 60.0 * np.log(true / 20.0) + 12.0 * np.log(true / 20.0) ** 2
        return np.array([first, 30.0 - 25.0 * np.log(true / 20.0) + values[1] - 31.0])

    one = Cells(toes if toe is None else toe, ["0", "1"], parameters=PARAMETERS, noise=noise)
    one.targets = targets(50.0, 30.0)
    one.scene = SimpleNamespace(spacing=spacing, sliding_height=20.0)
    return one


class Cells(Formula):
    """A formula whose points can be jittered."""

    def jittered(self, jitter: float, seed: int) -> Cells:
        other = copy(self)
        other.seed = 1000 * self.seed + seed
        return other


@pytest.mark.parametrize("factor", [0.6, 1.5, 2.0])
def test_the_limit_is_found_from_two_spacings(factor):
    here = cells_of(1.0)
    found = small_cells(here, here, VALUES, [cells_of(factor)])
    assert found.known and found.other_spacing_m == factor
    assert found.factor == pytest.approx(np.exp(0.04), rel=2e-3)
    assert found.log_std == pytest.approx(np.hypot(SHARE_STD * 0.04, NOISE_STD), rel=0.02)
    assert here.runs == (7 if factor > 1.0 else 5)


def test_the_factor_leaves_the_same_slide_and_angles_alone():
    here, other = cells_of(1.0), cells_of(2.0)
    found = same_slide(here, here, VALUES, other)
    (left,) = other.predict([other.at(VALUES * [np.exp(found.log), 1.0])])
    (there,) = here.predict([here.at(VALUES)])
    assert left.values == pytest.approx(there.values, abs=0.1)


def test_noise_of_the_runs_is_averaged_and_told():
    found = []
    for seed in range(60):
        here, other = cells_of(1.0), cells_of(2.0, noise=0.5)
        other.seed = seed
        found.append(same_slide(here, here, VALUES, other))
    # A factor of e moves one toe by 60 m and the other by 25 m; each run errs by 0.5 m.
    one = 0.5 / np.hypot(60.0, 25.0)
    assert np.std([slide.log for slide in found]) == pytest.approx(one / np.sqrt(6.0), rel=0.25)
    told = np.sqrt(np.mean([slide.noise**2 for slide in found]))
    assert told == pytest.approx(one * np.sqrt(1.0 / 6.0 + 1.0 / 4.0), rel=0.2)
    assert np.mean([slide.log for slide in found]) == pytest.approx(
        -0.04 * (2.0**ORDER - 1.0), abs=0.004
    )


def test_cells_that_lie_too_far_apart_are_asked_at_the_next_spacing():
    here = cells_of(1.0, cost=0.2)
    odd = cells_of(2.0, cost=0.3)
    found = small_cells(here, here, VALUES, [odd, cells_of(0.6, cost=0.2)])
    assert found.other_spacing_m == 0.6
    assert found.factor == pytest.approx(np.exp(0.2), rel=0.02)


def test_where_all_lie_too_far_nothing_is_taken_off_and_the_strength_is_less_certain():
    here = cells_of(1.0, cost=0.4)
    found = small_cells(here, here, VALUES, [cells_of(0.6, cost=0.4)])
    assert not found.known and found.factor == 1.0
    assert found.log_std == pytest.approx(0.4, rel=0.05) and found.log_std > FARTHEST
    assert "a smaller spacing would tell" in found.words


def test_what_a_second_spacing_tells_is_checked_by_a_third():
    here = cells_of(1.0)
    agreed = small_cells(here, here, VALUES, [cells_of(2.0), cells_of(1.5), cells_of(0.6)])
    assert (agreed.other_spacing_m, agreed.runs) == (2.0, 14)
    # Thin zones of strong soil, say, are lost 2 m apart: the limit seems to be reached.
    deceived = [cells_of(2.0, cost=0.04 / 2.0**ORDER), cells_of(1.5), cells_of(0.6)]
    found = small_cells(here, here, VALUES, deceived)
    assert found.other_spacing_m == 1.5 and found.factor == pytest.approx(np.exp(0.04), rel=3e-3)
    assert found.log_std == pytest.approx(np.hypot(SHARE_STD * 0.04, 0.04), rel=0.1)


def test_larger_cells_that_ask_for_more_strength_tell_nothing():
    here = cells_of(1.0, cost=-0.16)
    # Another that obeys the law is not asked: it would be chosen for that.
    found = small_cells(here, here, VALUES, [cells_of(2.0, cost=-0.16), cells_of(0.6)])
    assert not found.known and found.factor == 1.0 and "more strength" in found.words
    assert found.log_std == pytest.approx(SHARE_STD * 0.16, rel=0.05)
    found = small_cells(here, here, VALUES, [cells_of(0.6, cost=-0.16)])
    assert not found.known and "less strength" in found.words


def test_runs_that_scatter_more_than_cells_cost_tell_nothing():
    here, other = cells_of(1.0), cells_of(1.5, noise=6.0)
    found = small_cells(here, here, VALUES, [other])
    assert not found.known and "scatter" in found.words and found.log_std == UNKNOWN_STD
    found = small_cells(here, here, VALUES, [other, cells_of(0.6)])
    assert found.other_spacing_m == 0.6


def test_another_spacing_has_four_rows_of_points_in_what_liquefied():
    drawing = read_section(DRAWINGS / "quay.csv")  # 5 m of liquefied sand
    asked, told = {1.0: [0.6], 0.8: [1.2, 0.48], 0.6: [1.2, 0.9, 0.36]}, {}
    for spacing in asked:
        scene = section_scene(drawing, source="a.csv", name="a", unit=None, spacing=spacing)
        there = SectionSetup(scene, SimulationSettings(), PARAMETERS, targets(50.0), None)
        others = other_spacings(there, point_count(scene), 2, "a.csv")
        told[spacing] = [round(one.scene.spacing, 3) for one in others]
    assert told == asked


def test_without_another_spacing_the_cells_are_not_known():
    here = cells_of(1.0)
    found = small_cells(here, here, VALUES, [])
    assert found == SmallCells.unknown(here.scene, "no other spacing can be run")
    assert (found.factor, found.log_std) == (1.0, UNKNOWN_STD)


@pytest.mark.parametrize(
    ("spacing", "doubt"), [(0.5, UNKNOWN_STD), (2.0, UNKNOWN_STD * 2.0**ORDER), (8.0, MOST_LOG)]
)
def test_of_few_spacings_in_the_height_less_is_known(spacing, doubt):
    found = SmallCells.unknown(cells_of(spacing).scene, "nobody looked")
    assert found.log_std == pytest.approx(doubt) and not found.known
    seen = SmallCells.unknown(cells_of(spacing).scene, "nobody looked", seen=0.3)
    assert seen.log_std == pytest.approx(max(doubt, 0.3))


def test_runs_that_fail_or_do_not_notice_the_strength_tell_nothing():
    here = cells_of(1.0)
    for toe in (lambda values: np.array([np.nan, np.nan]), lambda values: np.array([48.0, 29.0])):
        assert same_slide(here, here, VALUES, cells_of(2.0, toe=toe)) is None
        found = small_cells(here, here, VALUES, [cells_of(2.0, toe=toe), cells_of(1.5)])
        assert found.other_spacing_m == 1.5

    # A number that the coarser run does not have is left out, the others count.
    def one_alone(values):
        return np.array([cells_of(2.0)._one(values).values[0], np.nan])

    left = same_slide(here, here, VALUES, cells_of(2.0, toe=one_alone))
    assert left.log == pytest.approx(-0.04 * (2.0**ORDER - 1.0), abs=0.01)


def test_an_engine_in_small_cells_runs_what_its_cells_need():
    here = cells_of(1.0)
    cells = small_cells(here, here, VALUES, [cells_of(2.0)])
    engine, limit = InSmallCells(here, cells), cells_of(0.0)
    (told,), (true,), (ran,) = (
        one.predict([setup.at(VALUES)])
        for one, setup in ((engine, here), (limit, limit), (here, here))
    )
    assert here.asked[-2] == pytest.approx(VALUES / [cells.factor, 1.0])
    assert told.values == pytest.approx(true.values, abs=0.2)
    assert ran.values != pytest.approx(true.values, abs=0.9)
    assert engine.error_std(here.at(VALUES)).tolist() == [0.0, 0.0]


def test_a_prior_is_of_the_soil_and_not_of_the_runs():
    cells = SmallCells(factor=1.21, log_std=0.1, spacing_m=1.0, other_spacing_m=2.0, words="")
    assert cells.factors(PARAMETERS).tolist() == [pytest.approx(1.21), 1.0]
    half = cells.factors(PARAMETERS, np.array([0.5, 0.5]))
    assert half.tolist() == [pytest.approx(1.1), 1.0]
    assert cells.factors(PARAMETERS, np.array([0.0, 1.0])).tolist() == [1.0, 1.0]


QUAY = """zone,x,y,material,friction_deg,cohesion_kpa,density,liquefied
sand,-60,-4.3,sand,0,20,1950,true
sand,50,-4.3
sand,50,0.2
sand,-60,0.2
caisson,0,0.2,caisson,0,300,2100
caisson,7,0.2
caisson,7,9.3
caisson,0,9.3
fill,7,0.2,fill,33,0,1950
fill,50,0.2
fill,50,9.3
fill,7,9.3
water,-60,7.5
water,50,7.5
"""
"""Its toe runs 9.6 m with 9 kPa in small cells."""


@pytest.mark.slow
def test_a_quay_whose_sand_has_four_and_a_half_rows_of_points(tmp_path):
    # With a second spacing of three rows it was 7.8 +- 0.3 kPa: the errors of both cancelled.
    (tmp_path / "quay.csv").write_text(QUAY)
    drawn = Given(section=str(tmp_path / "quay.csv"), spacing_m=1.0, runouts=["left=9.6+-0.48"])
    make_case(str(tmp_path / "quay"), drawn)
    result = back_analyse(tmp_path / "quay", quick=True, out=tmp_path / "out", threads=1)
    (found,) = result.answer.parameters
    assert result.answer.small_cells.other_spacing_m == 0.6
    assert abs(np.log(found.value / 9.0)) < 2.0 * found.std_total / found.value < 0.3
