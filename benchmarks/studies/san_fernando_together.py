"""Toe, crest, freeboard, time and delay of Lower San Fernando together: which physics gives them?

    python -m benchmarks.studies.san_fernando_together [--spacing M] [--write]

Pore water that flows, the drag of the reservoir and the softening of core and rolled fill, each
alone and together, and a zone that is small at first and spreads. Under each, S_r is what lets the
upstream toe run as far as measured; nothing else is fitted. Upper San Fernando has the same physics
and the same S_r / sigma'_v0, and stood.
`--write` renews the table of `docs/method/effects.md`.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.generated_pages import EFFECTS_PAGE, renew, table
from benchmarks.studies.pore_water_picture import let_flow, start_s
from geometry.case import load_case
from geometry.scenes.scene import Scene
from inversion.estimation.forward import deposit_of_run
from mpm_taichi.layout import YY
from mpm_taichi.simulate import simulate_each
from mpm_taichi.trajectory import Run
from pipeline.config import SimulationSettings
from pipeline.table import aligned

LOWER, UPPER = "lower_san_fernando", "upper_san_fernando"
TOE, SHOWN = "upstream toe", ("crest", "freeboard", "duration")
STRENGTHS_KPA = np.arange(4.0, 46.0, 3.0)
CLOSER_KPA = (-1.0, 0.0, 1.0)
"""Around what the first strengths give."""
PERMEABILITY, DILATANCY = 3e-4, 0.2
"""Of the fill [m/s]; of the soil that does not liquefy."""
LOWEST = "fill_1"
"""What the names of the lowest layers of the shells end with."""
SPREAD_PERMEABILITY, ABOVE_RATIO = 1e-4, 0.3
"""Of the fill [m/s], and r_u at t = 0 of the layers above, where the lowest layer liquefies alone.

The digital section of Montgomery (2025) has 1.1e-6 m/s along the layers and 5e-8 across: see the
page.
"""
SPREAD = {"dilatancy": 0.1, "dilation": 0.003}
"""Of the layers above: medium dense, some 0.3 % of volume up to the critical state."""
CLAYS = ("core", "rolled_fill", "ground_shale")
PEAK = 3.0
"""Their strength before they shear over that which the section has, after shaking: of the core 0.37
of its vertical effective stress, below the drained strength at the 35 degrees of the section."""


HEADS = ["with", "S_r (kPa)", "S_r/σ'_v0", "crest (m)", "freeboard (m)", "takes (s)", "starts (s)",
         "Upper San Fernando: toe (m)", "crest (m)"]  # fmt: skip


@dataclass(frozen=True)
class Physics:
    """What acts.

    Attributes:
        words: of the table.
        effects: and their amplitudes.
        flows: pore water flows.
        lowest: only the lowest layer has liquefied.
        peak: strength of the clays over that of the section.
    """

    words: str
    effects: Mapping[str, float]
    flows: bool = False
    lowest: bool = False
    peak: float = 1.0


def each_and_together() -> list[Physics]:
    """None, each alone, pairs, and all."""
    drag, soft = {"water_drag": 1.0}, {"remoulding": 0.5}
    return [
        Physics("base model", {}),
        Physics("drag of the pool, C_d 1; 4", drag),
        Physics("", {"water_drag": 4.0}),
        Physics("core and rolled fill lose 20 %; 50; 70", {"remoulding": 0.2}),
        Physics("", soft),
        Physics("", {"remoulding": 0.7}),
        Physics("pore water flows", {}, flows=True),
        Physics("flows, C_d 1", drag, flows=True),
        Physics("flows, 50 %", soft, flows=True),
        Physics("C_d 1, 50 %", {**drag, **soft}),
        Physics("flows, C_d 1, 50 %", {**drag, **soft}, flows=True),
        Physics("flows, lowest layer alone liquefied", {}, flows=True, lowest=True),
        *(
            Physics(words, {"remoulding": loss}, flows=True, lowest=True, peak=PEAK)
            for words, loss in (("the same, clay at 3 x, loses 67 %; 80", 1 - 1 / PEAK), ("", 0.8))
        ),
    ]


def section(
    name: str, physics: Physics, spacing: float, *, s_r: float = 0.0, ratio: float | None = None
) -> Scene:
    """A dam with a strength [kPa], or a ratio S_r / sigma'_v0, of what liquefied."""
    scene = load_case(name).scene
    soils = scene.model_dump()["materials"]
    soils["liquefied_fill"]["cohesion_kpa"] = s_r
    if ratio is not None:
        soils["liquefied_fill"]["strength_ratio"] = ratio
    for clay in (one for one in CLAYS if one in soils):
        soils[clay]["cohesion_kpa"] *= physics.peak
    permeability = SPREAD_PERMEABILITY if physics.lowest else PERMEABILITY
    flow = let_flow(soils, permeability, DILATANCY) if physics.flows else {}
    changes = {"spacing": spacing, "materials": soils, "effects": {**physics.effects, **flow}}
    if physics.lowest:
        flow["pore_water"] |= SPREAD
        soils["layer_above"] = {**soils["fill"], "excess_pressure_ratio": ABOVE_RATIO}
        changes["zones"] = lowest_alone(scene)
    return scene.changed(**changes)


def lowest_alone(scene: Scene) -> list[dict[str, Any]]:
    """The zones, in which the lowest layers alone have liquefied."""
    zones = scene.model_dump()["zones"]
    for zone in zones:
        if zone["material"] == "liquefied_fill" and not zone["name"].endswith(LOWEST):
            zone["material"] = "layer_above"
    return zones


def readings(name: str, run: Run) -> dict[str, float]:
    """Single lengths and times of the survey, as the run has them, and the start of its slide."""
    case = load_case(name)
    feet = {side: run.scene.foot(side) for side in ("left", "right")}
    deposit = deposit_of_run(run, feet)
    found = {
        entry.name: float(entry.reading(deposit).values[0])
        for entry in case.measured
        if len(entry.values) == 1
    }
    found["start"] = start_s(run, feet["left"])
    ratio = run.scene.materials["liquefied_fill"].cohesion_kpa / vertical_stress_kpa(run)
    return found | {"ratio": ratio}


def vertical_stress_kpa(run: Run) -> float:
    """Mean vertical effective stress of what liquefied, before the slide [kPa]."""
    number = list(run.scene.materials).index("liquefied_fill")
    return float(-run.initial_stress[run.material == number, YY].mean() / 1e3)


def fitted(
    models: Sequence[Physics], spacing: float, threads: int | None
) -> list[tuple[float, dict[str, float]]]:
    """S_r [kPa] by which the toe of Lower San Fernando is as measured, and all readings by it."""
    case = load_case(LOWER)
    measured = next(e.value_m for e in case.measured if e.name == TOE)
    guesses = [STRENGTHS_KPA] * len(models)
    for around in (np.array(CLOSER_KPA), np.zeros(1)):
        wanted = [
            (place, s_r, section(LOWER, models[place], spacing, s_r=float(s_r)))
            for place, strengths in enumerate(guesses)
            for s_r in strengths
        ]
        toes: list[list[tuple[float, float]]] = [[] for _ in models]
        settings = SimulationSettings()
        runs = simulate_each([(scene, settings) for *_, scene in wanted], threads=threads)
        for number, run in runs:
            place, s_r, _ = wanted[number]
            toes[place].append((readings(LOWER, run)[TOE], s_r))
        guesses = [np.interp(measured, *zip(*sorted(one), strict=True)) + around for one in toes]
    best = [float(strengths[0]) for strengths in guesses]
    last = [
        (section(LOWER, one, spacing, s_r=s_r), SimulationSettings())
        for one, s_r in zip(models, best, strict=True)
    ]
    found = dict(simulate_each(last, threads=threads))
    return [(s_r, readings(LOWER, found[place])) for place, s_r in enumerate(best)]


def rows_of(models: Sequence[Physics], spacing: float, threads: int | None) -> list[list[str]]:
    """The cells of the table."""
    lower = fitted(models, spacing, threads)
    stood = [
        (section(UPPER, one, spacing, ratio=found["ratio"]), SimulationSettings())
        for one, (_, found) in zip(models, lower, strict=True)
    ]
    upper = dict(simulate_each(stood, threads=threads))
    rows = []
    for place, (one, (s_r, found)) in enumerate(zip(models, lower, strict=True)):
        moved = readings(UPPER, upper[place])
        figures = (s_r, found["ratio"], *(found[name] for name in SHOWN), found["start"])
        toes = max(moved["downstream toe"], moved["upstream toe"])
        cells = [f"{value:.2f}" if abs(value) < 1.0 else f"{value:.1f}" for value in figures]
        rows.append([one.words, *cells, f"{toes:.1f}", f"{moved['crest']:.1f}"])
    return rows


def main(argv: Sequence[str] | None = None) -> None:
    """Simulate, print, and where asked renew the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--spacing", type=float, default=2.0, help="of points [m]; default: 2")
    parser.add_argument("--threads", type=int, help="default: all")
    parser.add_argument("--write", action="store_true", help="renew docs/method/effects.md")
    chosen = parser.parse_args(argv)
    rows = rows_of(each_and_together(), chosen.spacing, chosen.threads)
    rows.append(["**measured**", "", "", "20 ± 1", "1.5 ± 0.5", "40 ± 10", "20 to 40", "< 3", "1"])
    print(aligned([HEADS, *rows], left={0}))
    if chosen.write:
        renew(EFFECTS_PAGE, together=table(HEADS, rows, "lrrrrrrrr"))


if __name__ == "__main__":
    main()
