"""Measurements read on a kept run of a section."""

from __future__ import annotations

import numpy as np

from geometry.scenes.overburden import mean_and_deviation, stress_in_kpa
from geometry.survey.ends import ends_reached
from geometry.survey.measured import Deposit
from inversion.engines.run_store import KeptRun
from inversion.estimation.data import read, toes_by_eye
from inversion.estimation.forward import Prediction, SectionSetup
from inversion.problem.question import RESIDUAL_STRENGTH, STRENGTH_RATIO


def read_start(setup: SectionSetup, run: KeptRun) -> np.ndarray:
    """The measurements read on the section before anything moved, (m,)."""
    return read(setup.targets, deposit_of(setup, run, last=False))[0]


def prediction_of(
    setup: SectionSetup, run: KeptRun, at_start: np.ndarray | None = None
) -> Prediction:
    """Read the measurements on a run; `at_start` is `read_start` where that is known."""
    end = deposit_of(setup, run)
    failed = run.status == "failed"
    values, trouble = read(setup.targets, end, run.readings)
    if failed:
        values = np.full(len(values), np.nan)
    if at_start is None:
        at_start = read_start(setup, run)
    mean, spread = _sigma_v0(setup, run)
    broken = failed or not np.all(np.isfinite(values[setup.targets.fitted]))
    return Prediction(
        values=values,
        at_start=at_start,
        by_eye={} if failed else toes_by_eye(setup.targets, end),
        positions=run.moved[0],
        volume=run.moved[1],
        status="failed" if broken else "finished",
        reason=run.reason or trouble,
        sigma_v0_kpa=mean,
        sigma_v0_std_kpa=spread,
        run_time_s=run.wall_time_s,
        at_rest=run.at_rest or failed,
        spacing_m=setup.scene.spacing,
        remarks=_remarks(setup, run),
    )


def _remarks(setup: SectionSetup, run: KeptRun) -> tuple[str, ...]:
    if len(run.initial) != len(run.final):  # a direct model's are not the same points
        return ()
    return ends_reached(setup.scene, run.initial, run.final)


def deposit_of(setup: SectionSetup, run: KeptRun, *, last: bool = True) -> Deposit:
    """The points of a run as measurements see them: after the slide, or before it."""
    return Deposit.on(
        setup.scene,
        setup.foot,
        (run.final if last else run.initial).astype(float),
        run.initial.astype(float),
        run.initial_volume.astype(float),
        volume=run.volume if last else None,
        at_rest=run.at_rest or not last,
    )


def _sigma_v0(setup: SectionSetup, run: KeptRun) -> tuple[np.ndarray, np.ndarray]:
    """Mean and spread of the vertical effective stress over the zones of each S_r or ratio.

    Of an S_r it is the weight above, what practice divides by. Of a ratio it is the settled stress
    that the run multiplied, so that their product is the mean strength of the run.

    Returns:
        (p,) and (p,) [kPa]; NaN for other parameters.
    """
    gravity = setup.settings.gravity_m_per_s2
    volume = run.initial_volume.astype(float)
    stress = stress_in_kpa(setup.scene, run.initial.astype(float), volume, run.zone, gravity)
    settled = 1e-3 * np.maximum(run.vertical_stress.astype(float), 0.0)
    found = []
    for spec in setup.parameters.specs:
        zones = [number for number, one in enumerate(setup.scene.zones) if one.name in spec.zones]
        own = np.isin(run.zone, zones)
        of_zones = settled if spec.property == STRENGTH_RATIO else stress
        known = spec.property in (RESIDUAL_STRENGTH, STRENGTH_RATIO) and own.any()
        found.append(mean_and_deviation(of_zones[own], volume[own]) if known else (np.nan, np.nan))
    mean, spread = np.array(found, dtype=float).reshape(-1, 2).T
    return mean, spread
