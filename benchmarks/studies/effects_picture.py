"""What each effect does to the Lower San Fernando section, over its ladder of amplitudes.

    python -m benchmarks.studies.effects_picture [--spacing M] [--threads N]

Simulates the section with each effect at the three amplitudes of its ladder (and their negatives
where it has two signs), prints how far surface, upstream toe and highest remnant move from those
of the base model, and draws the final surfaces as `docs/images/effects.png`. The last line printed
is noise: the same section with its points moved by a tenth of the spacing.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.dam_section import dam_section
from geometry.scenes.scene import Scene
from geometry.survey.freeboard import freeboard
from geometry.survey.surface_profile import surface_profile
from geometry.survey.toe_runout import toe_runout
from mpm_taichi.effects import Effect, effects
from mpm_taichi.trajectory import Run
from pipeline.config import SimulationSettings
from pipeline.files import atomic_path
from pipeline.table import aligned

ROOT = Path(__file__).parents[2]
PICTURE = ROOT / "docs/images/effects.png"
UPSTREAM_FOOT = 76.02
"""x of the upstream foot of the section [m]."""
SHOWN = (-60.0, 250.0)
"""Part of the section that is drawn and compared, x [m]; the downstream slope does not move."""
BASE_LINE = "#8a8a8a"
SHADES = ("#9ecae1", "#3182bd", "#08306b")
STATED = {
    "strength_contrast": ("the lower half", {"y_m": 6.0, "half_height_m": 4.0}),
    "inertial_friction": ("rockfill of 0.3 m", {"grain_size_mm": 300.0}),
}
"""Effects that need a parameter to be seen here: in words, and as in a scene."""
SEEDS = 6
"""Moved points whose spread is called noise."""


@dataclass(frozen=True)
class Deposit:
    """A run as a survey sees it."""

    surface: np.ndarray  # (X,) elevation [m]
    toe: float  # upstream runout [m]
    remnant: float  # highest remaining ground above the pool [m]

    def beside(self, base: Deposit) -> list[float]:
        """Root mean square and greatest change of the surface, changes of toe and remnant [m]."""
        change = self.surface - base.surface
        return [
            float(np.sqrt(np.mean(change**2))),
            float(np.abs(change).max()),
            self.toe - base.toe,
            self.remnant - base.remnant,
        ]


def main() -> None:
    """Simulate, print, draw."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--spacing", type=float, default=3.0, help="of points [m]; default: 3")
    parser.add_argument("--threads", type=int, help="default: all")
    parser.add_argument("--out", type=Path, default=PICTURE)
    arguments = parser.parse_args()
    section = dam_section().changed(spacing=arguments.spacing)
    x = np.arange(*SHOWN, 1.0)
    chosen = [one for one in effects().values() if not one.applies(section)]
    wanted = [(one, amplitude) for one in chosen for amplitude in signed_ladder(one)]
    scenes = [section.changed(effects={one.name: entry(one, a)}) for one, a in wanted]
    moved = [section.changed(jitter=0.2, seed=seed) for seed in range(1, SEEDS + 1)]
    runs = simulated([section, *moved, *scenes], arguments.threads)
    deposits = [deposit(run, x) for run in runs]
    base, noise, found = deposits[0], deposits[1 : SEEDS + 1], deposits[SEEDS + 1 :]
    print(table(wanted, runs[SEEDS + 1 :], found, noise, base))
    draw(x, base, chosen, dict(zip(wanted, found, strict=True)), section, arguments.out)
    print(f"wrote {arguments.out}")


def signed_ladder(one: Effect) -> Iterator[float]:
    """Amplitudes of the ladder, with their negatives where those mean something."""
    for amplitude in one.amplitude.ladder:
        yield amplitude
        if one.amplitude.two_signed:
            yield -amplitude


def entry(one: Effect, amplitude: float) -> dict[str, float]:
    """An effect as a scene has it."""
    _, numbers = STATED.get(one.name, ("", {}))
    return {"amplitude": amplitude, **numbers}


def simulated(scenes: list[Scene], threads: int | None) -> list[Run]:
    """The runs of all scenes."""
    from mpm_taichi.simulate import simulate

    return simulate(scenes, SimulationSettings(), threads=threads)


def deposit(run: Run, x: np.ndarray) -> Deposit:
    """What a survey sees at the end."""
    scene = run.scene
    position, volume = run.positions[-1].astype(float), run.bulk_volume
    ground = np.asarray(scene.ground.points, dtype=float)
    surface = surface_profile(position, volume, x, spacing=scene.spacing, ground=ground)
    toe = toe_runout(
        position, volume, side="left", initial_toe=UPSTREAM_FOOT, spacing=scene.spacing
    )
    remnant = freeboard(position, volume, spacing=scene.spacing, water_level=scene.water_level)
    return Deposit(surface, float(toe), float(remnant))


def table(wanted, runs, found, noise, base) -> str:  # noqa: ANN001
    """How far everything moves, one line a run; shares of energy; noise last."""
    rows = [["effect", "amplitude", "rms m", "max m", "toe m", "remnant m", "to rest s",
             "numerical %", "status"]]  # fmt: skip
    for (one, amplitude), run, after in zip(wanted, runs, found, strict=True):
        numbers = [f"{value:+.2f}" for value in after.beside(base)]
        numerical = f"{100 * float(run.audit['numerical_share']):.2f}"
        rows.append([one.name, f"{amplitude:g}", *numbers, f"{run.time[-1]:.1f}", numerical,
                     run.reason or run.status])  # fmt: skip
    spread = np.sqrt(np.mean([np.square(one.beside(base)) for one in noise], axis=0))
    rows.append(["points moved", "", *(f"{value:.2f}" for value in spread), "", "", ""])
    return aligned(rows, left={0, 8})


def draw(x, base, chosen, found, section, path: Path) -> None:  # noqa: ANN001
    """Small multiples: the final surface with each effect, and its difference from the base's."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    columns = 3
    lines = -(-len(chosen) // columns)
    figure = Figure(figsize=(13, 2.7 * lines + 0.4), layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.add_gridspec(lines, columns, hspace=0.05)
    for place, one in enumerate(chosen):
        inner = grid[place // columns, place % columns].subgridspec(2, 1, height_ratios=(3, 2))
        upper, lower = inner.subplots(sharex=True)
        upper.fill_between(x, section.ground.lowest, base.surface, color="#e3e3e3", lw=0)
        upper.plot(x, base.surface, color=BASE_LINE, lw=2.0, label="base")
        upper.axhline(section.water_level, color="#2a6fa8", lw=0.7, ls=(0, (6, 2)))
        lower.axhline(0.0, color=BASE_LINE, lw=1.0)
        for amplitude, shade in zip(one.amplitude.ladder, SHADES, strict=True):
            unit = f" {one.amplitude.unit}" if one.amplitude.unit else ""
            label = f"{amplitude:g}{unit}"
            for sign, style in ((1, "-"), (-1, (0, (3, 2))))[: 1 + one.amplitude.two_signed]:
                surface = found[one, sign * amplitude].surface
                upper.plot(x, surface, color=shade, lw=1.2, ls=style,
                           label=label if sign > 0 else None)  # fmt: skip
                lower.plot(x, surface - base.surface, color=shade, lw=1.2, ls=style)
        words, _ = STATED.get(one.name, ("", {}))
        upper.set_title(f"{one.name}{words and f': {words}'}", fontsize=11, loc="left", pad=3)
        upper.legend(fontsize=7.5, loc="upper left", frameon=False, ncols=2, handlelength=1.4)
        upper.set(xlim=SHOWN, ylim=(0.0, 54.0), ylabel="y (m)")
        lower.set_ylabel("change (m)")
        for ax in (upper, lower):
            ax.spines[["top", "right"]].set_visible(False)
            ax.tick_params(labelsize=8)
    figure.supxlabel("x (m), upstream is left", fontsize=10)
    with atomic_path(path) as temporary:
        figure.savefig(temporary, dpi=85)


if __name__ == "__main__":
    main()
