"""What learned models say of the dams of the case histories, next to the solver.

    python -m benchmarks.studies.learned_on_dams                          # the direct model
    python -m benchmarks.studies.learned_on_dams --simulator models/thrust

No case history was learned from. The direct model's tables are part of the page that
`benchmarks.studies.direct_models` leaves; a stepping simulator runs with the water that it knows.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import flowslide
from benchmarks.generated_pages import table
from geometry.case import load_case
from geometry.scenes.scene import Scene
from inversion.back_analysis.case import inversion_case
from inversion.back_analysis.result import Result
from inversion.engines.gns_engine import GNSEngine
from inversion.engines.registry import MPM, engine_named
from inversion.engines.rollout_store import RolloutStore
from inversion.engines.run_store import RunStore
from inversion.engines.trained_model import TrainedModel, load_model
from inversion.estimation.forward import Prediction, SectionSetup
from inversion.estimation.unknowns import Parameters
from pipeline.config import load_config

WORDS = (
    "The direct model next to the solver, both at the same strengths: those of the back-analyses, "
    "and others around them (`python -m benchmarks.studies.learned_on_dams`)."
)
ANSWERS = (
    "What each finds from the toes alone (`flowslide invert DAM --quick --spacing S --engine "
    "direct`): by itself, with its own error in the ±, and corrected by five runs of the solver "
    "around its first answer (`--set inversion.paired_runs=5`, "
    "[how](#how-sure-it-is)). At 1 m Lower San Fernando is 42 spacings high, "
    "which the model has not learned. The last column is what the solver makes of the corrected "
    "answer; the measured runouts are in brackets."
)
#: Runs that correct an answer.
PAIRED = 5
CASES = Path("case_histories")
HEAD = ("dam", "points, m", "strengths, kPa", "number", "solver, m", "model off by, m")


@dataclass(frozen=True)
class Asked:
    """Strengths at which a dam is run.

    Attributes:
        case: of `case_histories`; title: of the table.
        spacing: of the points [m].
        strengths: of the question's parameters, in its order [kPa].
    """

    case: str
    title: str
    spacing: float
    strengths: tuple[tuple[float, ...], ...]


DAMS = (
    Asked("lower_san_fernando", "Lower San Fernando", 2.0, ((15.0,), (19.8,), (25.0,))),
    Asked("upper_san_fernando", "Upper San Fernando", 2.0, ((30.0,), (40.0,))),
    Asked(
        "la_marquesa", "La Marquesa", 0.5,
        ((1.5, 10.3, 7.1), (3.0, 8.0, 6.0), (1.0, 6.0, 5.0)),
    ),
)  # fmt: skip

ANSWERS_HEAD = (
    "| dam | points, m | S_r by the solver, kPa | direct model alone | with five runs | "
    "toes by the solver at the last, m |\n|---|---|---|---|---|---|"
)
#: Title, case and spacing [m].
QUESTIONS = (
    ("Lower San Fernando", "lower_san_fernando", 2.0),
    ("Lower San Fernando", "lower_san_fernando", 1.0),
    ("La Marquesa", "la_marquesa", 0.5),
)

#: Strengths, materials and zones of the variants of Lower San Fernando.
SAND = {"friction_deg": 35.0, "cohesion_kpa": 0.0}
CLAY = {"friction_deg": 0.0, "cohesion_kpa": 150.0}
CAP = ("ground_shale", "rolled_fill")
LIQUEFIED = tuple(f"upstream_fill_{number}" for number in (1, 2, 3, 4))
DIKE = "upstream_starter_dike"
#: Strengths at which the variants of Lower San Fernando are run [kPa].
STRENGTHS = (15.0, 19.8, 25.0)
VARIANTS_WORDS = (
    "Lower San Fernando at 2 m with one thing changed: upstream toe by the solver and, after it, "
    "how far the direct model is off (m), at three strengths."
)
VARIANTS_HEAD = (
    "| variant | " + " | ".join(f"{one:g} kPa" for one in STRENGTHS) + " |\n|---|---|---|---|"
)


def compared(
    asked: Asked, setup: SectionSetup, found: Sequence[list[Prediction]]
) -> list[list[str]]:
    """Cells of the rows of a dam: every toe, and the crest where it was measured.

    Args:
        asked: the strengths.
        setup: what was predicted.
        found: by the solver and by a model, at each of the strengths.
    """
    given = "; ".join(", ".join(f"{one:g}" for one in strengths) for strengths in asked.strengths)
    rows = []
    for number, name in enumerate(setup.targets.names):
        if "toe" in name or name == "crest":
            solver, model = ([one.values[number] for one in answers] for answers in found)
            off = (f"{other - own:+.1f}" for own, other in zip(solver, model, strict=True))
            figures = ("; ".join(f"{own:.1f}" for own in solver), "; ".join(off))
            rows.append([asked.title, f"{asked.spacing:g}", given, name, *figures])
    return rows


def lines(asked: Asked) -> list[list[str]]:
    """Rows of the table."""
    setup = inversion_case(load_case(CASES / asked.case)).setup
    setup = setup.with_scene(setup.scene.changed(spacing=asked.spacing))
    return compared(asked, setup, both(setup, asked.strengths, RunStore(None)))


def simulator_lines(asked: Asked, model: TrainedModel) -> list[list[str]]:
    """The same of a stepping simulator."""
    water = "pore_pressure" if model.simulator.config.thrust else "buoyant"
    case = load_case(CASES / asked.case, load_config(None, [f"simulation.water={water}"]))
    setup = inversion_case(case, spacing_m=asked.spacing).setup
    requests = [setup.at(np.array(values)) for values in asked.strengths]
    engines = (MPM.forward(RunStore(None)), GNSEngine(RolloutStore(None), model))
    return compared(asked, setup, [engine.predict(requests) for engine in engines])


def both(
    setup: SectionSetup, strengths: Sequence[Sequence[float]], store: RunStore
) -> list[list[Prediction]]:
    """What the solver and the direct model predict at strengths [kPa]."""
    requests = [setup.at(np.array(values)) for values in strengths]
    return [engine.forward(store).predict(requests) for engine in (MPM, engine_named("direct"))]


def dams(rows_of: Callable[[Asked], list[list[str]]] = lines) -> str:
    """Table of all dams."""
    return table(HEAD, [row for asked in DAMS for row in rows_of(asked)], "lrllrr")


def with_strengths(scene: Scene, materials: tuple[str, ...], strength: dict[str, float]) -> Scene:
    """The section in which some materials have another strength."""
    for material in materials:
        scene = scene.with_strength(material, **strength)
    return scene


def with_zones(scene: Scene, changes: dict[str, str]) -> Scene:
    """The section with other materials in some of its zones."""
    zones = [
        {**zone.model_dump(), "material": changes.get(zone.name, zone.material)}
        for zone in scene.zones
    ]
    return scene.changed(zones=zones)


@dataclass(frozen=True)
class Variant:
    """Lower San Fernando with one thing changed.

    Attributes:
        words: what; change: of the section.
        liquefied: zones that have the strength in question.
    """

    words: str
    change: Callable[[Scene], Scene] = lambda scene: scene
    liquefied: tuple[str, ...] = LIQUEFIED


VARIANTS = (
    Variant("as it is"),
    Variant("no water", lambda scene: scene.changed(water_level=None, phreatic_line=None)),
    Variant(
        "its cap of friction",
        lambda scene: with_strengths(scene, CAP, SAND),
    ),
    Variant(
        "its cap of strong clay",
        lambda scene: with_strengths(scene, CAP, CLAY),
    ),
    Variant("its core of friction", lambda scene: with_strengths(scene, ("core",), SAND)),
    Variant(
        "its starter dike liquefied",
        lambda scene: with_zones(scene, {DIKE: "liquefied_fill"}),
        (*LIQUEFIED, DIKE),
    ),
    Variant(
        "its lowest layer alone liquefied",
        lambda scene: with_zones(scene, dict.fromkeys(LIQUEFIED[1:], "fill")),
        LIQUEFIED[:1],
    ),
)


def variants() -> str:
    """Table of Lower San Fernando with one thing changed."""
    case = inversion_case(load_case(CASES / "lower_san_fernando"), spacing_m=2.0)
    store, rows = RunStore(None), []
    for variant in VARIANTS:
        (spec,) = case.parameters.specs
        sought = Parameters([spec.model_copy(update={"zones": list(variant.liquefied)})])
        setup = replace(case.setup.with_scene(variant.change(case.setup.scene)), parameters=sought)
        place = setup.targets.names.index("upstream toe")
        solver, direct = (
            np.array([one.values[place] for one in found])
            for found in both(setup, [[strength] for strength in STRENGTHS], store)
        )
        cells = [f"{own:.0f}, {off:+.0f}" for own, off in zip(solver, direct - solver, strict=True)]
        rows.append(f"| {variant.words} | {' | '.join(cells)} |")
    return "\n".join([VARIANTS_HEAD, *rows])


def answers() -> str:
    """Table of the back-analyses, by the solver, by the model and by the corrected model."""
    rows = (answer_of(title, name, spacing) for title, name, spacing in QUESTIONS)
    return "\n".join([ANSWERS_HEAD, *rows])


def answer_of(title: str, name: str, spacing: float) -> str:
    """One row of `answers`."""
    solver, alone, corrected = (
        _answer(name, spacing, engine=engine, pairs=pairs)
        for engine, pairs in ((MPM.name, 0), ("direct", 0), ("direct", PAIRED))
    )
    setup = inversion_case(load_case(CASES / name), spacing_m=spacing).setup
    found = np.array([one.as_run for one in corrected.answer.parameters])
    (judged,) = MPM.forward(RunStore(None)).predict([setup.at(found)])
    numbers = zip(setup.targets.names, judged.values, setup.targets.measured, strict=True)
    toes = [f"{own:.1f} ({target:g})" for number, own, target in numbers if "toe" in number]
    cells = [title, f"{spacing:g}", *map(_strengths, (solver, alone, corrected)), ", ".join(toes)]
    return f"| {' | '.join(cells)} |"


def _answer(name: str, spacing: float, *, engine: str, pairs: int) -> Result:
    settings = load_config(None)
    changed = settings.inversion.model_copy(update={"paired_runs": pairs})
    return flowslide.back_analyse(
        CASES / name,
        engine=engine,
        quick=True,
        spacing_m=spacing,
        settings=settings.model_copy(update={"inversion": changed}),
    )


def _strengths(result: Result) -> str:
    parameters = result.answer.parameters
    return ", ".join(f"{one.value:.1f} ± {one.std_total:.1f}" for one in parameters)


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--simulator", metavar="DIR", help="a stepping simulator instead")
    given = parser.parse_args().simulator
    if given is None:
        print(f"{dams()}\n\n{answers()}\n\n{variants()}")
    else:
        model = load_model(given)
        print(dams(lambda asked: simulator_lines(asked, model)))


if __name__ == "__main__":
    main()
