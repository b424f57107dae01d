"""Kinetics, ZIF and IMM: motion, balance of energy, and what one says about the other."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from geometry.case import load_case
from inversion.classical import imm, kinetics, zif
from inversion.classical.analysis import Workbench
from inversion.classical.judgement import load_judgements
from inversion.classical.limit_equilibrium import required_strength
from inversion.classical.morph import MorphedSlide
from inversion.classical.sections_of_case import case_sections
from inversion.classical.slices import Polyline
from inversion.classical.slide_forces import SlideForces, sum_forces
from pipeline.cli import WorkFailed

SLIP = np.array([[0.0, 0.0], [28.0, 0.0], [38.0, 10.0]])
AFTER = np.array(
    [[-14.0, 0.0], [-12.0, 1.6], [0.0, 3.4], [15.0, 5.0], [30.0, 5.8], [34.0, 6.4], [38.0, 10.0]]
)


def forces(x, y, driving, length, resistance=0.0, weight=4e6, mass=5e5) -> SlideForces:
    return SlideForces(driving, length, resistance, weight, mass, np.array([x, y]), 1.2 * length)


BEFORE = forces(100.0, 20.0, 1.2e6, 60.0, 2e5)
LATER = forces(70.0, 14.0, 3e5, 90.0, 3e5)


@pytest.fixture
def slide(dam):
    return MorphedSlide(dam(), Polyline(SLIP), AFTER, "left")


@pytest.mark.parametrize("end_slope", ["slip", "level"])
@pytest.mark.parametrize("stages", ["varying", "before", "after"])
def test_kinetics_stops_where_the_body_was_found(end_slope, stages):
    body = kinetics.body_of(BEFORE, LATER, -1, end_slope=end_slope, stages=stages)
    strength, motion = kinetics.find_strength(body)
    assert motion.travel[-1] == pytest.approx(body.path.arc_length(), rel=2e-4)
    assert motion.velocity[[0, -1]] == pytest.approx([0.0, 0.0])
    assert strength == pytest.approx(body.energy_strength(), rel=1e-3)


def test_energy_of_the_kinetics_balances_on_the_way():
    body = kinetics.body_of(BEFORE, LATER, -1)
    strength, motion = kinetics.find_strength(body)
    kinetic = 0.5 * body.mass * motion.velocity**2
    force = body.mass * motion.acceleration
    work = np.append(0.0, np.cumsum(0.5 * (force[1:] + force[:-1]) * np.diff(motion.travel)))
    assert kinetic == pytest.approx(work, abs=1e-3 * kinetic.max())
    # Gravity's share is the weight times the drop, for the weight is the same before and after.
    assert body.work(0.0) + _resisted(body) == pytest.approx(4e6 * 6.0, rel=1e-4)


def _resisted(body) -> float:
    """Work of T over the path: T grows evenly with the horizontal travel."""
    x = np.linspace(0.0, body.path.length, 4001)
    arc = [np.hypot(1.0, body.path.slope(place)) for place in x]
    held = np.interp(x, [0, body.path.length], body.resistance)
    return float(np.trapezoid(held * arc, x))


def test_half_the_time_step_changes_little():
    body = kinetics.body_of(BEFORE, LATER, -1)
    coarse = body.slide(9e3, 0.01)
    fine = body.slide(9e3, 0.005)
    assert coarse.travel[-1] == pytest.approx(fine.travel[-1], rel=1e-5)
    assert coarse.duration == pytest.approx(fine.duration, rel=1e-3)


def test_block_on_a_straight_slope_by_hand():
    """Driving force and resistance constant: constant acceleration, s = a t^2 / 2."""
    slope = 6.0 / 30.0
    path = kinetics.Path(np.array([0.0, 0.0]), 30.0, 6.0, -slope, -slope, 1)
    body = kinetics.Body((4e6, 4e6), (60.0, 60.0), (1e5, 1e5), 5e5, path)
    force = 4e6 * slope / np.hypot(1.0, slope) - 60.0 * 8e3 - 1e5
    assert body.force(10.0, 8e3) == pytest.approx(force)
    assert path.arc_length() == pytest.approx(np.hypot(30.0, 6.0), rel=1e-6)
    with pytest.raises(WorkFailed, match="does not stop"):
        body.slide(8e3)
    at_rest = body.slide(2e4)
    assert at_rest.travel[-1] == 0.0 and at_rest.duration == 0.0


def test_path_goes_through_both_centres_with_both_slopes():
    body = kinetics.body_of(BEFORE, LATER, -1)
    points = body.path.points(3001)
    assert points[[0, -1]] == pytest.approx(np.array([[100.0, 20.0], [70.0, 14.0]]))
    slopes = np.diff(points[:, 1]) / -np.diff(points[:, 0])
    sine = np.array([1.2e6, 3e5]) / 4e6
    assert slopes[[0, -1]] == pytest.approx(-np.tan(np.arcsin(sine)), abs=1e-3)
    middle = 15.0
    assert body.path.slope(middle) == pytest.approx(float(slopes[1500]), abs=1e-3)


def test_a_centre_that_rises_is_no_slide():
    with pytest.raises(WorkFailed, match="both must be positive"):
        kinetics.body_of(LATER, BEFORE, -1)


def test_more_strength_less_travel():
    body = kinetics.body_of(BEFORE, LATER, -1)
    travels = [body.slide(strength).travel[-1] for strength in (8.5e3, 9e3, 9.5e3, 1.2e4)]
    assert all(a > b for a, b in pairwise(travels))


# --- IMM ---


def five(drivings, lengths, xs):
    return [forces(x, 0.0, d, length) for x, d, length in zip(xs, drivings, lengths, strict=True)]


def test_two_blocks_by_hand():
    """Driving force falls evenly from 1.0 to 0 MN/m over 40 m, length 50 m throughout.

    Work of the driving force 20 MJ/m; S_r 50 m x 40 m takes it up at 10 kPa. Force balances half
    way; v^2 = 2/m x (1.0 x 20 / 2 - ...) = 2 / 5e5 x 0.25 x 20 MJ there.
    """
    shares = np.linspace(0, 1, 5)
    stages = five(1e6 * (1 - shares), [50.0] * 5, 40 * shares)
    strength, motion = imm.find_strength(stages, shares)
    assert strength == pytest.approx(1e4, rel=1e-9)
    assert motion.zero_inertia_share == pytest.approx(0.5, abs=1e-9)
    assert motion.velocity[2] ** 2 == pytest.approx(2 * 5e6 / 5e5, rel=1e-9)
    # Acceleration linear in the travel: half a swing, pi / sqrt(k), k = 1e6 / 5e5 / 40.
    assert motion.duration == pytest.approx(np.pi / np.sqrt(1e6 / 5e5 / 40), rel=1e-6)


def test_time_between_two_sections_against_small_steps():
    for a0, a1, v0, ds in [(1.0, 0.4, 0.5, 3.0), (0.2, 0.9, 1.0, 4.0), (0.5, 0.5, 0.0, 2.0)]:
        v1 = np.sqrt(v0**2 + (a0 + a1) * ds)
        s = ds * np.linspace(0, 1, 400_001) ** 2  # finer where the velocity is small
        v = np.sqrt(v0**2 + 2 * (a0 * s + 0.5 * (a1 - a0) * s**2 / ds))
        steps = 2 * np.diff(s) / (v[1:] + v[:-1])
        assert imm._duration(a0, a1, v0, v1, ds) == pytest.approx(steps.sum(), rel=1e-4)


def test_too_few_sections_and_masses_that_stop_early():
    stages = five([1e6] * 4, [50.0] * 4, [0, 1, 2, 3])
    with pytest.raises(ValueError, match="at least 5"):
        imm.find_strength(stages, [0, 0.3, 0.6, 1])
    shares = np.linspace(0, 1, 5)
    with pytest.raises(WorkFailed, match="even without S_r"):
        imm.find_strength(five([-1e6] * 5, [50.0] * 5, 10 * shares), shares)
    late = five([1e5, 1e5, 1e5, 3e6, 3e6], [50.0] * 5, 10 * shares)
    with pytest.raises(WorkFailed, match="would stop at 25 %"):
        imm.find_strength(late, shares)


def test_a_mass_that_would_stop_between_two_sections_is_refused():
    """v^2 is positive at every section, yet nil within the last step but one."""
    shares = np.linspace(0, 1, 5)
    stages = five([1.0e6, 0.6e6, 0.0, 0.95e6, 0.3e6], [50.0] * 5, 40 * shares)
    strength = 1e4
    assert np.all(imm.squared_velocity(stages, strength)[1:] > 0)
    low = imm.least_squared_velocity(stages, strength)
    fine = np.array([least_by_small_steps(stages, strength, step) for step in (1, 2)])
    assert low[1:3] == pytest.approx(fine, abs=1e-3)  # the steps on which it brakes first
    assert low[2] < 0 < imm.squared_velocity(stages, strength)[3]


def least_by_small_steps(stages, strength, step):
    a0, a1 = (stage.net(strength) / stage.mass for stage in stages[step : step + 2])
    start = imm.squared_velocity(stages, strength)[step]
    ds = np.diff(imm.travel_of(stages))[step]
    s = np.linspace(0, ds, 20_001)[1:]
    return np.min(start + 2 * (a0 * s + 0.5 * (a1 - a0) * s**2 / ds))


def test_imm_and_zif_agree_at_the_share_where_the_forces_balance(slide):
    shares = np.linspace(0, 1, 21)
    stages = [sum_forces(slide.slices(slide.section(float(f)))) for f in shares]
    strength, motion = imm.find_strength(stages, shares)
    balance = motion.zero_inertia_share
    assert 0.2 < balance < 0.8
    slices = slide.slices(slide.section(balance))
    assert zif.find_strength(slices, "ordinary") == pytest.approx(strength, rel=0.01)


def test_kinetics_and_imm_agree_where_the_path_follows_the_slip_surface():
    """A rigid block on a bent plane: both methods see the same forces, so find the same S_r."""
    shares = np.linspace(0, 1, 201)
    x = 100.0 - 30.0 * shares
    sines = np.linspace(0.35, 0.05, 201)
    steps = -30.0 / 200 * np.tan(np.arcsin(0.5 * (sines[1:] + sines[:-1])))
    y = 20.0 + np.append(0.0, np.cumsum(steps))
    stages = [
        forces(xk, yk, 4e6 * s, 60.0 + 30.0 * f)
        for xk, yk, s, f in zip(x, y, sines, shares, strict=True)
    ]
    by_momentum, _ = imm.find_strength(stages, shares)
    body = kinetics.body_of(stages[0], stages[-1], -1)
    by_kinetics, _ = kinetics.find_strength(body)
    assert by_kinetics == pytest.approx(by_momentum, rel=5e-3)


def test_zif_says_when_there_is_no_answer(slide, dam):
    with pytest.raises(WorkFailed, match="stands without S_r"):
        flat = np.array([[-60.0, 0.0], [-59.0, 2.2], [36.0, 3.4], [38.0, 10.0]])
        gone = MorphedSlide(dam(), Polyline(SLIP), flat, "left")
        zif.find_strength(gone.slices(gone.section(1.0)), "ordinary")
    strong = zif.find_strength(slide.slices(slide.section(0.1)), "force")
    weak = zif.find_strength(slide.slices(slide.section(0.2)), "force")
    assert strong > weak > 0
    without = zif.find_strength(slide.slices(slide.section(0.2)), "force", others=0.0)
    assert without > weak


def test_the_firm_soil_decides_imm_on_the_published_section(root):
    """IMM falls linearly with the share of the firm soils' strengths: Weber's 25.8 at 0.40."""
    case = case_sections(load_case(root / "case_histories/lower_san_fernando"))
    (judgement,) = load_judgements(case.folder, case.measurements)
    bench, shares = Workbench(case, judgement), np.linspace(0.0, 1.0, 11)
    slices = [bench.slices(judgement, float(share))[0] for share in shares]

    def strength(counted: float) -> float:
        stages = [sum_forces(one, others=counted) for one in slices]
        return 1e-3 * imm.find_strength(stages, shares.tolist())[0]

    without, half, whole = (strength(counted) for counted in (0.0, 0.5, 1.0))
    assert half == pytest.approx(0.5 * (without + whole), rel=1e-6)
    assert without > 35.0 and whole < 10.0
    assert strength(0.40) == pytest.approx(25.8, abs=0.1)
    # Spencer's method has no answer where all of it counts.
    middle = bench.slices(judgement, 0.45)[0]
    assert 1e-3 * float(required_strength(middle, "spencer", others=0.4)) == pytest.approx(
        26.0, abs=0.5
    )
    assert np.isnan(required_strength(middle, "spencer"))
