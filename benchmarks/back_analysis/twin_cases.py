"""Cases with a known strength: a section, a simulated slide, a noisy survey of it, and a question.

Sections are those of the random templates (a) to (d) that have a liquefied zone, and of both dams.
The slide is simulated with points jittered and closer together than in the fit. What is surveyed is
the toe and the surface, with random errors. Each twin becomes a case folder like any other, so the
back-analysis sees nothing but files.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.back_analysis.lab import CASES, LA_MARQUESA, LSFD
from benchmarks.dam_section import dam_section
from geometry.random_scenes.templates import draw_scene
from geometry.scenes.scene import Scene, load_scene, save_scene
from geometry.sides import Side
from geometry.survey.surface_profile import surface_profile
from geometry.survey.toe_runout import toe_runout
from inversion.engines.run_store import KeptRun, RunStore
from inversion.problem.scene_changes import with_properties
from pipeline.config import Config
from pipeline.files import write_text, yaml_text
from pipeline.random_numbers import Stream

#: Of strengths, jitter and survey. The search was improved on seed 7; the recorded seed is another.
SEED = 8
#: Spacing of the points of the slide / that of the fit; jitter of its points.
FINER, JITTER = 0.8, 0.5
#: Standard deviations of the surveyed toe and surface, as shares of the height of the section.
TOE_STD, PROFILE_STD = 0.03, 0.015
#: What the model is granted next to them, in spacings: a toe and a surface are known no better.
TOE_MODEL, PROFILE_MODEL = 0.5, 0.5
PROFILE_POINTS = 14
#: S_r is drawn log-uniformly, kPa: templates and the high dam, and the 8 m dam.
STRENGTHS, LOW_STRENGTHS = (5.0, 60.0), (2.0, 8.0)
#: A question makes sense where the toe runs at least this far and, with 30 % more strength, stops
#: this much earlier; shares of the height of the section.
LEAST_RUNOUT, LEAST_EFFECT, STRONGER = 0.3, 0.1, 1.3
DRAWS = 3


@dataclass(frozen=True)
class Plan:
    """A section of which a twin may be made.

    Attributes:
        name: unique.
        scene: at the spacing of the fit.
        zones: that liquefy and share the strength.
        side: where the runout is measured; None: where it is longer.
        strengths: S_r is drawn between them [kPa].
        start: first guess of the fit, whatever the truth [kPa].
        key: of the twin's random numbers.
    """

    name: str
    scene: Scene
    zones: list[str]
    side: Side | None
    strengths: tuple[float, float]
    start: float
    key: int


@dataclass(frozen=True)
class Truth:
    """A slide that makes a good question."""

    plan: Plan
    strength_kpa: float
    side: Side
    runout_m: float
    scene: Scene
    run: KeptRun

    @property
    def height(self) -> float:
        """Of the section above the base [m]."""
        return height_of(self.plan.scene)


def height_of(scene: Scene) -> float:
    """Highest vertex above the lowest ground [m]."""
    return max(y for zone in scene.zones for _, y in zone.polygon) - scene.ground.lowest


def plans(config: Config, *, spacing_m: float) -> Iterator[tuple[str, Plan]]:
    """(group, section), without end: templates in turn, both dams again and again."""
    lsfd, marquesa = dam_section(), load_scene(CASES / LA_MARQUESA / "scene.yaml")
    index = 0
    while True:
        if index % 4 == 0:
            high = lsfd.changed(spacing=2.0)
            low = marquesa.changed(spacing=0.4)
            number = index // 4
            yield LSFD, Plan(f"lsfd_{number}", high, ["1"], "left", (15.0, 30.0), 22.0,
                             10_000 + number)  # fmt: skip
            yield LA_MARQUESA, Plan(f"la_marquesa_{number}", low, ["1", "2", "6"], None,
                                    LOW_STRENGTHS, 8.0, 20_000 + number)  # fmt: skip
        scene = draw_scene(config, "coarse", index)
        liquefied = [z.name for z in scene.zones if scene.materials[z.material].liquefied]
        if scene.origin.template != "e" and liquefied:
            yield f"template {scene.origin.template}", Plan(
                f"template_{scene.origin.template}_{index:03d}",
                scene.changed(spacing=spacing_m), liquefied, None, STRENGTHS, 20.0, index,
            )  # fmt: skip
        index += 1


def truth_of(plan: Plan, config: Config, store: RunStore) -> Truth | None:
    """Draw a strength for which the question makes sense; None after `DRAWS` vain ones."""
    stream = Stream(SEED, plan.key)
    finer = plan.scene.changed(
        spacing=FINER * plan.scene.spacing, jitter=JITTER, seed=100_000 * SEED + plan.key
    )
    for _ in range(DRAWS):
        strength = float(np.exp(stream.uniform(*np.log(plan.strengths))))
        scenes = [
            with_properties(finer, [(z, "cohesion_kpa", factor * strength) for z in plan.zones])
            for factor in (1.0, STRONGER)
        ]
        run, stronger = store.fetch([(scene, config.simulation) for scene in scenes])
        if "failed" in (run.status, stronger.status) or not (run.at_rest and stronger.at_rest):
            continue
        for side in (plan.side,) if plan.side else _longer_first(scenes[0], run):
            here, there = (runout(scene, kept, side) for scene, kept in
                           zip(scenes, (run, stronger), strict=True))  # fmt: skip
            if _makes_sense(plan.scene, here, there, side):
                return Truth(plan, strength, side, here, scenes[0], run)
    return None


def runout(scene: Scene, run: KeptRun, side: Side) -> float:
    """Of a run's toe [m]."""
    return float(
        toe_runout(
            run.final.astype(float),
            run.initial_volume,
            spacing=scene.spacing,
            side=side,
            initial_toe=scene.foot(side),
        )  # fmt: skip
    )


def _longer_first(scene: Scene, run: KeptRun) -> list[Side]:
    sides: list[Side] = ["left", "right"]
    return sorted(sides, key=lambda side: -runout(scene, run, side))


def _makes_sense(scene: Scene, here: float, there: float, side: Side) -> bool:
    height = height_of(scene)
    wall = scene.domain.x_min if side == "left" else scene.domain.x_max
    room = abs(wall - scene.foot(side)) - 4.0 * scene.spacing
    far_enough = LEAST_RUNOUT * height <= here <= room
    return far_enough and here - there >= LEAST_EFFECT * height


def write_case(truth: Truth, folder: Path, *, cell_factor: float) -> None:
    """The case folder of a twin: section without the strength, noisy survey, question."""
    plan, height, spacing = truth.plan, truth.height, truth.plan.scene.spacing
    blank = with_properties(plan.scene, [(z, "cohesion_kpa", plan.start) for z in plan.zones])
    folder.mkdir(parents=True, exist_ok=True)
    save_scene(blank, folder / "scene.yaml")
    noise = np.random.default_rng([SEED, plan.key])
    x, y = _surveyed_surface(truth, noise)
    rows = [f"{a:.4f},{b:.4f},surveyed" for a, b in zip(x, y, strict=True)]
    write_text(folder / "profile.csv", "\n".join(["x_m,y_m,part", *rows]) + "\n")
    toe = truth.runout_m + TOE_STD * height * noise.standard_normal()
    common = {"std_is": "assumed", "confidence": "assumed", "source": "simulated, with noise"}
    entries = [
        {"name": "toe", "type": "toe_runout", "side": truth.side, "value_m": round(toe, 4),
         "std_m": round(TOE_STD * height, 4), "model_std_m": TOE_MODEL * spacing, **common},
        {"name": "surface", "type": "surface_profile", "file": "profile.csv",
         "std_m": round(PROFILE_STD * height, 4), "model_std_m": PROFILE_MODEL * spacing,
         **common},
    ]  # fmt: skip
    _write_yaml(folder / "measurements.yaml", {
        "case": plan.name, "upstream": truth.side, "initial": {}, "default_set": "survey",
        "sets": {"survey": entries},
    })  # fmt: skip
    _write_yaml(folder / "inversion.yaml", {
        "parameters": [{
            "name": "residual_strength", "zones": plan.zones, "property": "residual_strength_kpa",
            "start": plan.start, "low": 0.5, "high": 150.0,
        }],
        "loss": "misfit",
        "sensitivities": [{"name": "cell size", "kind": "cell_size", "factor": cell_factor}],
    })  # fmt: skip


def _surveyed_surface(truth: Truth, noise: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Places along the deposit, and its surface there with random errors [m]."""
    scene, position = truth.scene, truth.run.final.astype(float)
    toe = scene.foot(truth.side) + truth.runout_m * (-1.0 if truth.side == "left" else 1.0)
    middle = 0.5 * (scene.foot("left") + scene.foot("right"))
    inside = toe + (middle - toe) * 0.05
    x = np.sort(np.round(np.linspace(inside, middle, PROFILE_POINTS), 4))
    y = surface_profile(
        position, truth.run.initial_volume, x, spacing=scene.spacing,
        ground=np.asarray(scene.ground.points, dtype=float),
    )  # fmt: skip
    error = PROFILE_STD * truth.height * noise.standard_normal(len(x))
    return x, np.maximum(y + error, scene.ground.height(x) - 0.5 * truth.plan.scene.spacing)


def _write_yaml(path: Path, document: dict) -> None:
    write_text(path, yaml_text(document, allow_unicode=True))
