"""The material law, one point at a time, against a float64 solution found by enumeration."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize

from benchmarks.verification.material_paths import (
    SOILS,
    exact_path,
    exact_return,
    random_trials,
    tensor,
    turn_gradient,
)
from benchmarks.verification.mohr_coulomb_reference import (
    Soil,
    enumerate_return,
    stress_scale,
)
from benchmarks.verification.one_element import solver_path, solver_return
from mpm_taichi.materials.elasticity import elastic_constants
from mpm_taichi.materials.mohr_coulomb import (
    CAP,
    CORNER,
    INTERCEPT,
    NO_CAP,
    SIN_PHI,
    material_constants,
)
from tests.budget import examples

TOLERANCE = 1e-4
MANY = settings(max_examples=examples(150), deadline=None)

kilopascals = st.floats(-300.0, 300.0, width=32)
trials = st.tuples(kilopascals, kilopascals, kilopascals, kilopascals).map(
    lambda t: 1e3 * np.array([t], np.float32)
)


@st.composite
def soils(draw, capped=True) -> Soil:
    friction = draw(st.one_of(st.just(0.0), st.floats(5.0, 55.0)))
    cohesion = draw(st.one_of(st.just(0.0), st.floats(0.5, 100.0)))
    assume(friction > 0 or cohesion > 0)
    cap = draw(st.one_of(st.none(), st.floats(0.0, 50.0))) if capped else None
    return Soil(
        np.radians(friction),
        1e3 * cohesion,
        draw(st.sampled_from([3e6, 30e6, 100e6])),
        draw(st.sampled_from([0.0, 0.2, 0.3, 0.45])),
        None if cap is None else 1e3 * cap,
    )


def principal(stress: np.ndarray) -> np.ndarray:
    """Principal stresses (N, 3), the largest first."""
    return np.linalg.eigvalsh(tensor(stress))[:, ::-1]


def turned(stress: np.ndarray, angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    xx, yy, zz, xy = stress.T
    return np.stack(
        [
            c * c * xx + s * s * yy - 2 * s * c * xy,
            s * s * xx + c * c * yy + 2 * s * c * xy,
            zz,
            s * c * (xx - yy) + (c * c - s * s) * xy,
        ],
        axis=1,
    )


def scale_of(trial: np.ndarray, soil: Soil) -> float:
    return float(stress_scale(np.asarray(trial, float), soil).max())


@pytest.mark.parametrize("name", SOILS)
def test_return_agrees_with_enumeration(name):
    soil = SOILS[name]
    trial = random_trials(soil, 2000, np.random.default_rng(11))
    exact = exact_return(trial, soil)
    assert exact.unmet < 1e-9  # the reference meets every condition, and has one answer
    stress, plastic = solver_return(trial, soil)
    scale = stress_scale(trial.astype(float), soil)
    assert (np.abs(stress - exact.stress).max(axis=1) < TOLERANCE * scale).all()
    strain = scale / (2.0 * soil.shear_modulus)
    units = np.stack([strain, strain, scale * strain], axis=1)  # shear, opening, work
    assert (np.abs(plastic - exact.plastic) < TOLERANCE * units).all()


def test_random_trials_visit_every_region():
    random = np.random.default_rng(11)
    seen = set()
    for soil in SOILS.values():
        seen |= set(exact_return(random_trials(soil, 2000, random), soil).region)
    assert seen == {
        "elastic",
        "shear: main plane",
        "shear: edge hi = mid",
        "shear: edge mid = lo",
        "apex",
        "tension: one stress at the cap",
        "tension: two stresses at the cap",
        "tension: three stresses at the cap",
        "corner: shear and tension",
        "corner: shear and tension, hi = mid",
        "corner: shear and tension, mid = lo",
    }


@pytest.mark.parametrize("name", ["phi = 0", "phi = 0, cap", "phi = 0, cap 0"])
def test_enumeration_is_the_closest_point_where_all_flow_is_associated(name):
    # For phi = 0 shear flow is associated too, so the return is a projection in the energy norm:
    # a convex program, solved here by a method that knows nothing of planes and multipliers.
    soil = SOILS[name]
    normals, offsets, _ = soil.planes()
    compliance = np.linalg.inv(soil.elasticity) * soil.youngs_modulus
    size = 50e3
    for trial in np.random.default_rng(3).normal(0.0, 1.0, (12, 3)):
        found = minimize(
            lambda s, trial=trial: (s - trial) @ compliance @ (s - trial),
            np.full(3, min(soil.cap, 0.0) / size - 0.1),
            jac=lambda s, trial=trial: 2.0 * compliance @ (s - trial),
            method="SLSQP",
            constraints={
                "type": "ineq",
                "fun": lambda s: offsets / size - normals @ s,
                "jac": lambda s: -normals,
            },
            options={"ftol": 1e-14, "maxiter": 300},
        )
        returned = enumerate_return(size * trial[None], soil).stress[0] / size
        assert np.abs(returned - found.x).max() < 1e-5


@MANY
@given(soils(), trials)
def test_returned_stress_is_admissible_and_nothing_is_given_back(soil, trial):
    stress, plastic = solver_return(trial, soil)
    high, _, low = principal(stress)[0]
    slack = 1e-5 * scale_of(trial, soil)
    sine = np.sin(soil.friction)
    assert (high - low) + (high + low) * sine - 2 * soil.cohesion * np.cos(soil.friction) <= slack
    assert high - soil.cap <= slack
    strain = slack / soil.shear_modulus
    assert (plastic >= -strain * np.array([[1.0, 1.0, scale_of(trial, soil)]])).all()


@MANY
@given(soils(), trials)
def test_return_is_final(soil, trial):
    once, _ = solver_return(trial, soil)
    twice, _ = solver_return(once, soil)
    assert np.abs(twice - once).max() < 1e-5 * scale_of(trial, soil)


@MANY
@given(soils(), trials)
def test_admissible_stress_is_left_as_it_is(soil, trial):
    # The yield surface is convex: halfway from it to a stress well inside is inside.
    surface, _ = solver_return(trial, soil)
    inside = (0.5 * (surface + np.array([-50e3, -50e3, -50e3, 0.0]))).astype(np.float32)
    stress, plastic = solver_return(inside, soil)
    # To a rounding: the stress is put together again from centre and radius of its circle.
    assert np.abs(stress - inside).max() <= 2.0 * np.spacing(np.abs(inside).max())
    assert (plastic == 0).all()


@MANY
@given(soils(capped=False), trials)
def test_shear_return_keeps_the_mean_stress(soil, trial):
    pressed = trial - np.float32([300e3, 300e3, 300e3, 0.0])
    stress, plastic = solver_return(pressed, soil)
    assume(principal(stress)[0, 0] < soil.cap - 1.0)
    slack = 1e-6 * scale_of(pressed, soil)
    assert abs(stress[0, :3].mean() - pressed[0, :3].astype(float).mean()) < slack
    assert abs(plastic[0, 1]) < slack / soil.bulk_modulus


def test_without_a_cap_nothing_ever_opens():
    soil = SOILS["phi = 0"]
    _, plastic = solver_return(random_trials(soil, 2000, np.random.default_rng(4)), soil)
    assert (plastic[:, 1] == 0).all()


@MANY
@given(soils(), trials, st.floats(0.0, 6.3))
def test_return_turns_with_the_stress(soil, trial, angle):
    straight, plastic = solver_return(trial, soil)
    rotated, same = solver_return(turned(trial.astype(float), angle), soil)
    scale = scale_of(trial, soil)
    assert np.abs(turned(straight, angle) - rotated).max() < 1e-5 * scale
    assert np.abs(plastic - same).max() < 1e-5 * scale / soil.shear_modulus * max(1.0, scale)


@MANY
@given(soils(), trials)
def test_stress_and_strain_account_for_the_trial(soil, trial):
    # The part of the trial that is lost is D times a plastic strain with the trace reported.
    stress, plastic = solver_return(trial, soil)
    lost = (trial.astype(float) - stress)[0, :3].mean()
    limit = 1e-5 * scale_of(trial, soil) / soil.bulk_modulus
    assert abs(plastic[0, 1] - lost / soil.bulk_modulus) < limit


@pytest.mark.parametrize("name", SOILS)
def test_random_paths_agree_with_enumeration(name):
    soil, random = SOILS[name], np.random.default_rng(5)
    gradients = random.normal(0.0, 4e-4, (40, 25, 2, 2)).astype(np.float32)
    gradients[:, :, 1, 0] += 0.01
    gradients[:, :, 0, 1] -= 0.01
    begin = exact_return(np.tile(np.float32([-2e4, -5e4, -3e4, 0.0]), (25, 1)), soil).stress
    exact = exact_path(begin, gradients.astype(float), soil)
    found = solver_path(begin, gradients, soil)
    scale = max(np.abs(exact).max(), soil.cohesion)
    assert np.abs(found - exact).max() < TOLERANCE * scale


@pytest.mark.parametrize("angle", [1e-4, 0.01, 0.3, -0.7])
def test_rigid_rotation_turns_the_stress_and_keeps_its_invariants(angle):
    begin = np.array([[-80e3, -30e3, -50e3, 15e3], [10e3, 40e3, 0.0, -25e3]])
    gradients = np.tile(turn_gradient(angle), (1, 2, 1, 1))
    end = solver_path(begin, gradients, Soil(0.0, 1e9, 30e6, 0.3))[-1]
    # The strains of a turn are differences of numbers of size sin^2, times the stiffness.
    tolerance = 1e-6 * 80e3 + 1e-7 * np.sin(angle) ** 2 * 30e6
    assert np.abs(end - turned(begin, angle)).max() < tolerance
    assert np.abs(principal(end) - principal(begin)).max() < tolerance


def test_elasticity_is_hookes_law():
    soil = Soil(0.0, 1e9, 30e6, 0.3)
    across, upward, shear = 1e-3, -2e-3, 5e-4
    gradients = np.array([[across, shear], [shear, upward]])[None, None]
    end = solver_path(np.zeros((1, 4)), gradients, soil)[-1, 0]
    lame = soil.youngs_modulus * 0.3 / (1.3 * 0.4)
    second = 0.5 * (across * upward - shear * shear)  # so that the area is that of I + gradient
    volumetric, twice = across + upward + 2.0 * second, 2.0 * soil.shear_modulus
    strains = (across + second, upward + second, 0.0)
    expected = [lame * volumetric + twice * e for e in strains] + [twice * shear]
    assert end == pytest.approx(expected, rel=1e-6)


def constants(**changed):
    values = {"friction_angle": np.radians(30.0), "cohesion": 10e3}
    return material_constants(**{**values, **changed})


def test_cap_is_the_apex_unless_a_lower_one_is_set():
    apex = 10e3 / np.tan(np.radians(30.0))
    assert constants()[CAP] == pytest.approx(apex)
    assert constants(tension_cap=5e3)[CAP] == pytest.approx(5e3)
    assert constants(tension_cap=1e6)[CAP] == pytest.approx(apex)
    assert constants(cohesion=0.0)[CAP] == 0.0


def test_no_cap_without_friction_unless_one_is_set():
    assert constants(friction_angle=0.0)[CAP] == np.float32(NO_CAP)
    assert constants(friction_angle=0.0, tension_cap=0.0)[CAP] == 0.0


def test_constants_are_those_of_the_yield_functions():
    elastic = elastic_constants(youngs_modulus=30e6, poisson_ratio=0.3)
    shear, bulk = 30e6 / 2.6, 30e6 / 1.2
    assert elastic == pytest.approx([shear, bulk, 0.5 / shear, 1.0 / bulk])
    strength = constants(tension_cap=5e3)
    assert strength[:CAP] == pytest.approx([0.5, 2 * 10e3 * np.cos(np.radians(30.0))])
    high, low = strength[CAP], strength[CORNER]  # the corner lies on both surfaces
    assert (high - low) + (high + low) * strength[SIN_PHI] == pytest.approx(strength[INTERCEPT])
