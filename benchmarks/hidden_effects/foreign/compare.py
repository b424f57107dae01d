"""How far codes differ on the same slide: runout, top, surface, area.

`python -m benchmarks.hidden_effects.foreign.compare [--codes CODE ...]` prints the table of
docs/records/foreign-truth.md and writes its picture. A code is compared with the judge's own
solver, on the section, strength and ground that both are given. `--refine` prints instead how far
each code's runout depends on its spacing, on the sections of the sets.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from benchmarks.hidden_effects.foreign.hidden import Hidden, outward
from benchmarks.hidden_effects.foreign.slide import SOURCES, Slide, source
from benchmarks.hidden_effects.making.sections import load_section
from geometry.scenes.scene import Scene
from geometry.survey.columns import toe
from geometry.survey.surface_profile import surface_profile
from pipeline.cli import WorkFailed

ROOT = Path(__file__).resolve().parents[3]
IMAGE = ROOT / "docs/images/foreign-slides.png"
EMBANKMENT = ROOT / "docs/examples/hidden_effect"
SECTIONS = ROOT / "benchmarks/hidden_effects/sections"
TAILINGS = SECTIONS / "tailings_dam"
SPACING_M, DURATION_S, FRAMES, SEED = 1.0, 40.0, 40, 1
COLOURS = {"own": "C0", "newton": "C1", "smoothed_particles": "C2"}


@dataclass(frozen=True)
class Question:
    """A slide that every code makes.

    Attributes:
        words: what it is.
        folder: of the section; strength_kpa: S_r; contact: with the ground.
        hidden: in it.
        spacing: of the points [m].
        dry: without the section's water.
    """

    words: str
    folder: Path
    strength_kpa: float
    contact: str = "rough"
    hidden: tuple[Hidden, ...] = ()
    spacing: float = SPACING_M
    dry: bool = False

    @property
    def scene(self) -> Scene:
        """The section, with its strength."""
        scene = load_section(self.folder).scene.changed(spacing=self.spacing)
        if self.dry:
            scene = scene.changed(water_level=None)
        for name, soil in scene.materials.items():
            if soil.liquefied:
                scene = scene.with_strength(name, cohesion_kpa=self.strength_kpa)
        return scene.changed(ground=scene.ground.model_dump() | {"contact": self.contact})


QUESTIONS = (
    *(Question(f"embankment, {s:g} kPa", EMBANKMENT, s) for s in (9.0, 12.0, 16.0)),
    *(Question(f"tailings dam, {s:g} kPa", TAILINGS, s) for s in (15.0, 20.0, 25.0)),
    Question("embankment, 12 kPa, bonded ground", EMBANKMENT, 12.0, contact="no_slip"),
    Question("embankment, 12 kPa, pool", EMBANKMENT, 12.0, hidden=(Hidden("pool", 0.6),)),
    Question("embankment, 12 kPa, weak base", EMBANKMENT, 12.0,
             hidden=(Hidden("weak_base", 0.5),)),
    Question("embankment, 12 kPa, viscosity", EMBANKMENT, 12.0,
             hidden=(Hidden("viscosity", 30.0),)),
    Question("embankment, 12 kPa, with depth", EMBANKMENT, 12.0, hidden=(Hidden("depth", 0.8),)),
)  # fmt: skip
RESERVOIR = Question("reservoir dam, 22 kPa", SECTIONS / "reservoir_dam", 22.0)
EMBANKED = Question("embankment of the sets, 15 kPa", SECTIONS / "embankment", 15.0)
LAYERED = Question("tailings dam, 22 kPa", TAILINGS, 22.0)
#: A slide -> code -> spacings [m] at which it is made.
REFINED: tuple[tuple[Question, dict[str, tuple[float, ...]]], ...] = (
    (RESERVOIR, {"own": (3.5, 3.0, 2.0, 1.5, 1.0), "smoothed_particles": (3.5, 3.0, 2.0)}),
    (replace(RESERVOIR, words=f"{RESERVOIR.words}, dry", dry=True),
     {"own": (3.0, 1.5, 1.0), "smoothed_particles": (3.0,)}),
    (EMBANKED, {"own": (1.2, 0.8, 0.6, 0.4), "smoothed_particles": (1.2,), "newton": (1.2,)}),
    (replace(EMBANKED, words=f"{EMBANKED.words}, bonded", contact="no_slip"),
     {"own": (1.2, 0.8, 0.6, 0.4), "newton": (1.2, 0.8)}),
    (LAYERED, {"own": (1.3, 0.65), "smoothed_particles": (1.3,)}),
    (replace(LAYERED, words=f"{LAYERED.words}, bonded", contact="no_slip"), {"own": (1.3, 0.65)}),
)  # fmt: skip
DRAWN = ("embankment, 12 kPa", "tailings dam, 20 kPa", "embankment, 12 kPa, bonded ground")


def runout(slide: Slide, thin: float | None = None) -> float:
    """Distance of the toe from the foot on the side towards which the slide ran [m].

    Args:
        slide: of a code.
        thin: the toe is where the deposit is thinner than this [m]; None: than a spacing.
    """
    foot, sign = outward(slide.scene)
    side = "right" if sign > 0.0 else "left"
    middle = float(np.median(slide.initial[:, 0]))
    return sign * (
        toe(slide.final, slide.volumes, spacing=thin or slide.spacing, side=side, anchor_x=middle)
        - foot
    )


def surface(slide: Slide, x: np.ndarray) -> np.ndarray:
    """Elevation of the deposit [m] at `x` [m]."""
    base = slide.scene.ground.height(x)
    return np.maximum(surface_profile(slide.final, slide.volumes, x, spacing=slide.spacing), base)


def places(*slides: Slide) -> np.ndarray:
    """Where surfaces are compared [m]: over all deposits, not next to a wall."""
    ends = np.concatenate([one.final[:, 0] for one in slides])
    domain = slides[0].scene.domain
    first, last = ends.min() - 1.0, ends.max() + 1.0
    if domain.walls == "closed":  # the column height lacks what would be behind the wall
        first, last = max(first, domain.x_min + 4.0), min(last, domain.x_max - 4.0)
    return np.arange(first, last, 0.25)


def row(question: Question, name: str, slide: Slide, own: Slide, wall_s: float) -> str:
    """Of the table."""
    x = places(slide, own)
    ours, theirs = surface(own, x), surface(slide, x)
    rms = float(np.sqrt(np.mean((theirs - ours) ** 2)))
    return (
        f"| {question.words} | {name} | {runout(slide):.1f} | {theirs.max():.1f} | "
        f"{rms:.2f} | {slide.area_kept:.3f} | {wall_s:.0f} |"
    )


def draw(slides: dict[str, dict[str, Slide]], path: Path) -> None:
    """Surfaces of the same slide by every code, on top of each other."""
    figure, axes = plt.subplots(
        len(slides), 1, figsize=(9.0, 2.6 * len(slides)), layout="constrained"
    )
    for ax, (words, by_code) in zip(np.atleast_1d(axes), slides.items(), strict=True):
        first = next(iter(by_code.values()))
        for number, zone in enumerate(first.scene.zones):
            ring = np.array([*zone.polygon, zone.polygon[0]])
            ax.plot(*ring.T, color="0.6", lw=0.8, label="before" if not number else None)
        for name, slide in by_code.items():
            x = places(slide)
            label = f"{SOURCES[name].words}: {runout(slide):.1f} m"
            ax.plot(x, surface(slide, x), color=COLOURS[name], lw=1.6, label=label)
        ax.set(title=words, ylabel="y (m)", aspect=2.0)
        ax.legend(frameon=False, fontsize=8, loc="best")
    ax.set_xlabel("x (m)")
    figure.savefig(path, dpi=130)
    plt.close(figure)


def refine(codes: Sequence[str]) -> None:
    """Print the runouts of `REFINED`."""
    print("| slide | code | spacing, m | runout, m | read alike, m | top, m | area kept |")
    print("|---|---|---:|---:|---:|---:|---:|")
    for question, by_code in REFINED:
        coarsest = max(max(spacings) for spacings in by_code.values())
        for name in (code for code in by_code if code in codes):
            for spacing in by_code[name]:
                scene = replace(question, spacing=spacing).scene
                slide = source(name).simulate(
                    scene, (), duration_s=DURATION_S, frames=FRAMES, seed=SEED, threads=1
                )
                print(
                    f"| {question.words} | {name} | {spacing:g} | {runout(slide):.1f} | "
                    f"{runout(slide, coarsest):.1f} | {surface(slide, places(slide)).max():.1f} | "
                    f"{slide.area_kept:.3f} |",
                    flush=True,
                )


def main() -> None:
    """Compare."""
    parser = argparse.ArgumentParser(description="Slides by other codes against the judge's own.")
    parser.add_argument("--codes", nargs="+", choices=SOURCES, default=list(SOURCES))
    parser.add_argument("--refine", action="store_true", help="runouts at several spacings")
    arguments = parser.parse_args()
    codes = arguments.codes
    if arguments.refine:
        refine(codes)
        return
    print("| slide | code | runout, m | top, m | surface rms, m | area kept | wall, s |")
    print("|---|---|---:|---:|---:|---:|---:|")
    drawn: dict[str, dict[str, Slide]] = {}
    for question in QUESTIONS:
        scene, own, found = question.scene, None, {}
        for name in ["own", *(c for c in codes if c != "own")]:
            begin = time.perf_counter()
            try:
                slide = source(name).simulate(
                    scene, question.hidden, duration_s=DURATION_S, frames=FRAMES, seed=SEED,
                    threads=1,
                )  # fmt: skip
            except WorkFailed as error:
                print(f"| {question.words} | {name} | {error} | | | | |", flush=True)
                continue
            own = own or slide
            found[name] = slide
            wall_s = time.perf_counter() - begin
            print(row(question, name, slide, own, wall_s), flush=True)
        if question.words in DRAWN:
            drawn[question.words] = found
            draw(drawn, IMAGE)


if __name__ == "__main__":
    main()
