"""A simulated case compared with its survey: the deposit read as the survey did, side by side.

In: a `geometry.case.Case`. Out: a run, its readings, a table of what was measured and what was
simulated, and `observables.csv`. Data that are marked `constructed` are drawn and compared with
nothing.
"""

from __future__ import annotations

import csv
import math
import sys
from collections.abc import Callable
from contextlib import redirect_stdout
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from geometry.case import Case
from geometry.scenes.scene import Material
from geometry.sides import SIDES, Side
from geometry.survey.ends import ends_reached
from geometry.survey.measured import Deposit, Measured
from geometry.survey.toe_runout import toe_runout
from mpm_taichi.effects import effects_on
from mpm_taichi.trajectory import Run
from pipeline.cli import WorkFailed
from pipeline.files import atomic_path
from pipeline.table import aligned

FILMS = ("mp4", "gif", "none")
#: Type of a reading by eye, in tables.
BY_EYE = "naked_eye_toe"


@dataclass(frozen=True)
class ComparedReading:
    """One line of the table; in the measurement's unit.

    A reading by eye has no measurement to compare with. A profile is one line: the root mean square
    of its differences, which has no single measured value. What cannot be read is NaN, and
    `trouble` says why.
    """

    name: str
    type: str
    simulated: float
    at_start: float  # the same reading before anything moved; nothing is subtracted
    measurement: Measured | None = None
    measured: float | None = None
    part: str = ""  # of a measurement that is several values
    trouble: str = ""

    @property
    def unit(self) -> str:
        """Of the values."""
        return "m" if self.measurement is None else self.measurement.unit

    @property
    def difference(self) -> float | None:
        """Simulated minus measured, in `unit`; 0 while a limit is kept (`no_flow`)."""
        if self.measured is None or self.trouble:
            return None
        off = self.simulated - self.measured
        return max(off, 0.0) if self.measurement.censored else off

    @property
    def below(self) -> str:
        """What stands before the measured value: < where it is a limit."""
        return "< " if self.measurement is not None and self.measurement.censored else ""

    @property
    def difference_in_std(self) -> float | None:
        """The same in standard deviations of the survey."""
        return None if self.difference is None else self.difference / self.measurement.std

    @property
    def span(self) -> tuple[float, float] | None:
        """The stated range, where there is one [m]."""
        return None if self.measurement is None else self.measurement.stated_range


def simulate_case(
    case: Case,
    *,
    device: str = "cpu",
    threads: int | None = None,
    on_time: Callable[[float], None] | None = None,
) -> Run:
    """Simulate a case.

    Args:
        case: the case.
        device: "cpu" or "cuda".
        threads: CPU threads; None: all.
        on_time: called with the time reached [s] now and then.

    Raises:
        WorkFailed: a guard stopped the run.
    """
    from mpm_taichi.simulate import simulate

    def on_frame(place: int, time: float, kinetic: float) -> None:
        if on_time is not None:
            on_time(time)

    # Taichi reports its start on the standard output, where results alone belong.
    with redirect_stdout(sys.stderr):
        (run,) = simulate(
            [case.scene], case.simulation, device=device, threads=threads, on_frame=on_frame
        )
    if run.failed:
        raise WorkFailed(f"{case.scene.name}: stopped at {run.end_time_s:.3g} s: {run.reason}")
    return run


def read_deposit(case: Case, run: Run, *, at_start: bool = True) -> list[ComparedReading]:
    """Everything that was measured and not constructed, read at the end and at the start of a run.

    What was constructed is read too where it is a number, so that it can be shown. Where nothing
    was measured both toes are read.

    Args:
        case: that was simulated.
        run: of it.
        at_start: read the section before the slide as well; False: NaN, in half the time.
    """
    end, start = _deposit(case, run), _deposit(case, run, moved=False) if at_start else None
    readings = []
    if not case.measured:
        for side in SIDES:
            try:
                runouts = [math.nan if one is None else _runout(one, side) for one in (end, start)]
                readings.append(ComparedReading(side, "toe_runout", *runouts))
            except ValueError as error:  # nothing is as thick as a survey counts
                unread = (math.nan, math.nan)
                readings.append(ComparedReading(side, "toe_runout", *unread, trouble=str(error)))
    for measurement in case.measured:
        if measurement.as_one:
            if not measurement.constructed:
                readings.append(_reading_as_one(measurement, end, start))
            continue
        read = measurement.reading(end)
        before = _observed(measurement, start)
        for place, part in enumerate(measurement.parts):
            readings.append(
                ComparedReading(
                    measurement.name,
                    measurement.type,
                    float(read.values[place]),
                    float(before[place]),
                    measurement,
                    float(measurement.values[place]),
                    part,
                    read.trouble,
                )
            )
        by_eye = measurement.by_eye(end)
        if by_eye is not None:
            name = f"{measurement.name}, by eye"
            eye_before = math.nan if start is None else measurement.by_eye(start)
            readings.append(ComparedReading(name, BY_EYE, by_eye, eye_before))
    return readings


def _runout(deposit: Deposit, side: Side) -> float:
    """How far the toe ran on a side [m]."""
    return toe_runout(
        deposit.position,
        deposit.volume,
        spacing=deposit.spacing,
        side=side,
        initial_toe=deposit.foot[side],
        front=deposit.front.get(side),
    )


def _observed(measurement: Measured, deposit: Deposit | None) -> np.ndarray:
    """What a measurement reads; NaN of no deposit, and where it cannot be read."""
    if deposit is None:
        return np.full(len(measurement.values), np.nan)
    return measurement.reading(deposit).values


def _reading_as_one(measurement: Measured, end: Deposit, start: Deposit | None) -> ComparedReading:
    """A series as the root mean square of its differences."""
    rms = [
        float(np.sqrt(np.mean((_observed(measurement, deposit) - measurement.values) ** 2)))
        for deposit in (end, start)
    ]
    points = f"root mean square of {len(measurement.values)} points"
    return ComparedReading(measurement.name, measurement.type, *rms, measurement, part=points)


def _deposit(case: Case, run: Run, *, moved: bool = True) -> Deposit:
    """The last frame of a run with the way there, or the section before as if it had not moved."""
    positions = run.positions.astype(float)
    if not moved:
        positions = np.repeat(positions[:1], 2, axis=0)
    return Deposit.on(
        case.scene,
        case.feet,
        positions[-1],
        positions[0],
        run.initial_volume,
        volume=run.bulk_volume if moved else None,
        positions=positions,
        time=run.time if moved else run.time[[0, -1]],
        at_rest=not moved or run.came_to_rest,
    )


# --- text ---


def heading(case: Case, run: Run) -> str:
    """Summary of the simulation, in two lines, and one for each end of the drawing it reached."""
    scene = case.scene
    strengths = [
        f"{name.replace('_', ' ')} {_strength(material)}"
        for name, material in scene.materials.items()
        if material.liquefied
    ]
    water = "no water"
    if scene.has_water:
        water = f"water at {scene.water_level:g} m ({run.settings.water.replace('_', ' ')})"
    details = [*strengths, water, *(f"with {one.label}" for one in effects_on(scene))]
    rest = "at rest" if run.came_to_rest else "stopped"
    return (
        f"{case.title}: {'; '.join(details)}\n"
        f"{run.points:,} points every {scene.spacing:g} m; {rest} after {run.time[-1]:.1f} s of "
        f"motion, computed in {run.wall_time_s:.1f} s "
        f"({run.steps:,} steps, {run.settings.transfer})"
        + "".join(f"\nDoubtful: {line}" for line in ends_reached(scene, *run.positions[[0, -1]]))
    )


def _strength(material: Material) -> str:
    """S_r, or phi and c, in plain characters."""
    if material.strength_ratio is not None:
        return f"S_r/sigma'_v0 {material.strength_ratio:g}"
    if material.friction_deg == 0:
        return f"S_r {material.cohesion_kpa:g} kPa"
    return f"phi {material.friction_deg:g} deg, c {material.cohesion_kpa:g} kPa"


def table(case: Case, readings: list[ComparedReading]) -> str:
    """Measured and simulated values, one line each, and what to know about them."""
    rows = [["m", "measured", "std", "range", "simulated", "difference", "in std", "at t = 0", ""]]
    for reading in readings:
        m = reading.measurement
        known = ["", "", ""]
        trust = "not measured"
        if reading.type == BY_EYE:
            trust = "not what a survey reads: the outermost connected point"
        if m is not None:
            measured = ""
            if reading.measured is not None:
                measured = f"{reading.below}{reading.measured:.1f}"
            span = f"{reading.span[0]:g}-{reading.span[1]:g}" if reading.span else ""
            known = [measured, f"{m.std:g}", span]
            trust = f"value {m.confidence}, std {m.std_is}" + (", held out" if m.held_out else "")
        rows.append(
            [
                label(reading),
                *known,
                "not read" if reading.trouble else f"{reading.simulated:.1f}",
                "" if reading.difference is None else f"{reading.difference:+.1f}",
                "" if reading.difference is None else f"{reading.difference_in_std:+.1f}",
                f"{reading.at_start:.1f}",
                reading.trouble or trust,
            ]
        )
    for measurement in case.measured:
        if measurement.as_one and measurement.constructed:
            trust = f"{measurement.confidence}: drawn, not compared"
            rows.append([measurement.name, *[""] * 7, trust])
    note = (
        "Nothing is subtracted: a gentle foot that has not moved reads as short as `at t = 0` says "
        "(docs/method/geometry.md)."
    )
    return f"{aligned(rows, left={0, 8})}\n{note}"


def label(reading: ComparedReading) -> str:
    """The quantity in words, with the name of the measurement where that says more."""
    words = reading.type.replace("_", " ")
    if reading.type == BY_EYE:
        return "  by eye"
    words = words if reading.name in words else f"{words} ({reading.name})"
    words = f"{words}, {reading.part}" if reading.part else words
    return words if reading.unit == "m" else f"{words} [{reading.unit}]"


def energy_line(run: Run) -> str:
    """Where the released energy went, as shares of it; and the growth of the volume."""
    audit = run.audit
    released = float(audit["released_j_per_m"])
    shares = {
        "plastic": float(audit["plastic_share"]),
        "contact with ground and walls": float(audit["contact_share"]),
        "numerical": float(audit["numerical_share"]),
    }
    shares["change of elastic strain and motion"] = 1.0 - sum(shares.values())
    parts = ", ".join(f"{100 * share:.1f} % {name}" for name, share in shares.items())
    return (
        f"Energy: {released / 1e6:.0f} MJ per metre released: {parts}. "
        f"Volume of the points: {100 * float(audit['volume_growth']):+.2f} %."
    )


def water_line(run: Run) -> str:
    """What the pore water has done; empty where none flows."""
    if "water_expelled_m2" not in run.audit:
        return ""
    left, freed = (float(run.audit[f"water_{name}_m2"]) for name in ("expelled", "contracted"))
    excess = run.effect_fields["excess_pore_pressure_pa"] / 1e3
    return (
        f"Pore water: {left:.3g} m³ per metre left the soil, which contracted by {freed:.3g}; "
        f"excess pressure at the end {excess.min():.3g} to {excess.max():.3g} kPa."
    )


# --- files ---


def write_observables(path: Path, readings: list[ComparedReading]) -> None:
    """Write the readings as CSV; in metres, velocities in m/s as their column `unit` says."""
    columns = (
        "name,type,part,unit,measured,low,high,std,std_is,confidence,simulated,"
        "simulated_at_start,difference,difference_in_std,source"
    )
    with atomic_path(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns.split(","))
        for reading in readings:
            m = reading.measurement
            known = ["", "", ""] if m is None else [m.std, m.std_is, m.confidence]
            numbers = [
                None if reading.trouble else reading.simulated,
                reading.at_start,
                reading.difference,
                reading.difference_in_std,
            ]
            writer.writerow(
                [
                    reading.name,
                    reading.type,
                    reading.part,
                    reading.unit,
                    "" if reading.measured is None else reading.measured,
                    *(reading.span or ("", "")),
                    *known,
                    *("" if value is None else f"{value:.4f}" for value in numbers),
                    "" if m is None else m.source,
                ]
            )
