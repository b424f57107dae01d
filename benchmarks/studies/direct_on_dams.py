"""What the direct model says of the dams of the case histories, next to the solver.

    python -m benchmarks.studies.direct_on_dams

No case history was learned from. Part of the page that `benchmarks.studies.direct_models` leaves.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from geometry.case import load_case
from inversion.back_analysis.case import inversion_case
from inversion.engines.registry import MPM, engine_named
from inversion.engines.run_store import RunStore

WORDS = (
    "The direct model next to the solver, both at the same strengths: those of the back-analyses, "
    "and others around them (`python -m benchmarks.studies.direct_on_dams`). Five runs of the "
    "solver around its first answer correct it: with them the solver's toe is 53.2 m of 53.0 at "
    "Lower San Fernando (1 m between points), its toes 10.9 and 6.5 m of 11.0 and 6.5 at La "
    "Marquesa ([how](../method/direct.md#how-sure-it-is))."
)
CASES = Path("case_histories")
HEAD = (
    "| dam | points, m | strengths, kPa | number | solver, m | direct model, m | off, m |\n"
    "|---|---|---|---|---|---|---|"
)


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


def lines(asked: Asked) -> list[str]:
    """Rows of the table: every toe, and the crest where it was measured."""
    setup = inversion_case(load_case(CASES / asked.case)).setup
    setup = setup.with_scene(setup.scene.changed(spacing=asked.spacing))
    store = RunStore(None)
    requests = [setup.at(np.array(strengths)) for strengths in asked.strengths]
    found = [
        engine.forward(store).predict(requests) for engine in (MPM, engine_named("direct"))
    ]  # fmt: skip
    rows = []
    for strengths, solver, direct in zip(asked.strengths, *found, strict=True):
        for number, name in enumerate(setup.targets.names):
            if "toe" not in name and name != "crest":
                continue
            own, other = solver.values[number], direct.values[number]
            rows.append(
                f"| {asked.title} | {asked.spacing:g} | {', '.join(f'{s:g}' for s in strengths)} | "
                f"{name} | {own:.1f} | {other:.1f} | {other - own:+.1f} |"
            )
    return rows


def table() -> str:
    """Of all dams."""
    return "\n".join([HEAD, *(row for asked in DAMS for row in lines(asked))])


if __name__ == "__main__":
    print(table())
