"""The card of a model: what it is, what it has seen, how good it is, where it fails.

`card.yaml` lies next to the weights. Everything in it is measured or copied from the training; only
`note` is written by hand. `flowslide schema card` prints its schema.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import Field

from gns.evaluation.score_tables import by_template, quantile, worst
from pipeline.config import validate_settings
from pipeline.documents import StrictDocument, document_schema
from pipeline.files import read_yaml, write_text, yaml_text

if TYPE_CHECKING:
    from gns.evaluation.evaluate import Evaluated

CARD_FILE = "card.yaml"
FAR = 10.0
"""Travel [spacings] from which on a run counts as one that travels far."""

Table = dict[str, dict[str, float | None]]


class Training(StrictDocument):
    """How the model was made."""

    step: int = Field(description="step of the training that was kept")
    settings: dict[str, Any] = Field(description="of the training, batch_size of all processes")
    data_hash: str = Field(description="of the packed data")
    data_scale: str = Field(description="scale of the data; empty for scenes made by hand")
    runs: int = Field(description="runs it learned from")
    spacing_m: float = Field(description="distance between the points of these runs")
    validation: dict[str, float] = Field(description="of the runs by which it was chosen")


class Worst(StrictDocument):
    """A run with a large error of the runout."""

    run: int = Field(description="number of the run")
    template: str = Field(description="letter of its template")
    travel_spacings: float | None = Field(description="of the simulation's toe")
    runout_error_spacings: float | None = Field(description="positive: too far; null: it failed")


class Accuracy(StrictDocument):
    """Held-out rollouts; what has no meaning is null."""

    split: str = Field(description="of the packed data")
    runs: int = Field(description="how many")
    runs_that_travel_far: int = Field(description=f"by more than {FAR:g} spacings")
    by_template: Table = Field(description="medians; columns as in gns.evaluation.score_tables")
    far: dict[str, float | None] = Field(description="the same over the runs that travel far")
    one_step_error_spacings: float | None = Field(description="median over the runs")
    constant_velocity_error_spacings: float | None = Field(description="of no model at all")
    baselines: Table = Field(description="what guesses without any simulation reach")
    worst: list[Worst] = Field(description="the five largest errors of the runout")
    seconds_a_run: float = Field(description="median time of a rollout")
    mpm_seconds_a_run: float | None = Field(description="of the material point method")


class Card(StrictDocument):
    """The whole document."""

    name: str = Field(description="of the model")
    note: str = Field("", description="by hand")
    network: dict[str, Any] = Field(description="form and normalisation, without ranges")
    parameters: int = Field(description="number of weights")
    ranges: dict[str, tuple[float, float]] = Field(
        description="dimensionless ranges of the training, gns.data.ranges; it warns outside them"
    )
    contacts: list[str] = Field(description="kinds of ground in the training")
    training: Training
    accuracy: Accuracy
    known_failures: list[str] = Field(description="what was seen to go wrong, from the scores")
    weights_sha256: str = Field(description="of model.pt")
    manifest: dict[str, Any] = Field(description="code, packages, machine and time")


def accuracy(
    split: str, found: Sequence[Evaluated], baselines: Mapping[str, Mapping[str, float]]
) -> Accuracy:
    """The part of a card that an evaluation gives.

    Args:
        split: which runs these are.
        found: of each run.
        baselines: rows of numbers by the name of the baseline.
    """
    scores = [one.score for one in found]
    far = [one for one in scores if one.travel_m > FAR * one.spacing_m]
    times = [one.mpm_seconds for one in found if one.mpm_seconds is not None]
    return Accuracy(
        split=split,
        runs=len(scores),
        runs_that_travel_far=len(far),
        by_template={name: _row(row) for name, row in by_template(scores).items()},
        far=_row(by_template(far)["all"]) if far else {},
        one_step_error_spacings=_number(quantile((one.one_step_error for one in found), 0.5)),
        constant_velocity_error_spacings=_number(
            quantile((one.constant_velocity_error for one in found), 0.5)
        ),
        baselines={name: _row(row) for name, row in baselines.items()},
        worst=[
            Worst(
                run=one.run,
                template=one.template,
                travel_spacings=_number(one.travel_m / one.spacing_m),
                runout_error_spacings=_number(one.runout_error_spacings),
            )
            for one in worst(scores)
        ],
        seconds_a_run=float(quantile((one.seconds for one in found), 0.5)),
        mpm_seconds_a_run=_number(quantile(times, 0.5)) if times else None,
    )


def known_failures(found: Sequence[Evaluated]) -> list[str]:
    """Sentences on what went wrong in an evaluation."""
    scores = [one.score for one in found]
    said = []
    failed = [one for one in scores if not one.finite]
    if failed:
        runs = ", ".join(str(one.run) for one in failed[:10])
        said.append(f"{len(failed)} of {len(scores)} rollouts fail: runs {runs}")
    left = [one for one in scores if one.finite and not one.inside]
    if left:
        runs = ", ".join(str(one.run) for one in left[:10])
        said.append(f"in {len(left)} of {len(scores)} rollouts points leave the scene: runs {runs}")
    table = by_template(scores)
    whole = table["all"]["runout, d"]
    for letter, row in table.items():
        if letter != "all" and math.isfinite(whole) and row["runout, d"] > 2.0 * whole:
            said.append(
                f"template {letter}: the median error of the runout is {row['runout, d']:.1f} "
                f"spacings, of all templates {whole:.1f}"
            )
    bias = quantile((one.runout_error_spacings for one in scores), 0.5)
    if math.isfinite(bias) and abs(bias) > 0.5 * whole:
        side = "too far" if bias > 0 else "not far enough"
        said.append(f"rollouts run {side}: by {abs(bias):.1f} spacings in the median")
    return said


def write_card(path: str | Path, card: Card) -> None:
    """Write the card; the file appears when whole."""
    document = card.model_dump(mode="json")
    text = yaml_text(document, width=100, default_flow_style=None)
    write_text(path, text)


def read_card(path: str | Path) -> Card:
    """Read and check a card.

    Raises:
        InputError: no such file, or not a card.
    """
    return validate_settings(Card, read_yaml(path), origin=str(path))


def schema_text() -> str:
    """The JSON schema of a card, as text."""
    return document_schema(Card, "flowslide model card")


def _row(row: Mapping[str, float]) -> dict[str, float | None]:
    return {name: _number(value) for name, value in row.items()}


def _number(value: float) -> float | None:
    """Four digits; None for what has no meaning or no bound."""
    return float(f"{value:.4g}") if math.isfinite(value) else None
