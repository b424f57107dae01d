"""The judgement calls of a classical back-analysis: `classical.yaml` of a case folder.

In: the file, or nothing. Out: one `Judgement` per slide of the case (an upstream and a downstream
slide are two), with the values an analyst settled on and the alternatives he could have taken. A
case without the file gets one analysis per side on which a runout was measured, on the slip
surface that needs the highest S_r.
"""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pydantic import Field, model_validator

from geometry.scenes.scene import Document, checked_document
from geometry.sides import Side
from geometry.survey.measurements import Measurements
from geometry.survey.quantity import Confidence
from inversion.classical.kinetics import EndSlope, Stages
from inversion.classical.morph import BaseStrength
from pipeline.cli import InputError
from pipeline.files import read_yaml

FILE_NAME = "classical.yaml"

Water = Literal["buoyant", "pore_pressure", "none"]
WATER_WORDS = {
    "buoyant": "weights less uplift",
    "pore_pressure": "total weights with water pressure in and on the soil",
}
"""How each form of water reads; the keys are those of `simulation.water`."""
WaterLine = Literal["level", "phreatic"]

#: A slip surface that is looked for rather than given.
SEARCH = "search"


class Alternatives(Document):
    """Other values that are tried one at a time; every result is a point of the range."""

    unit_weight_factors: list[float] = Field([0.95, 1.05], description="all densities times this")
    zif_shares: list[float] = Field(
        [0.40, 0.50], description="shares of the displacement without acceleration"
    )
    sections: list[int] = Field([5, 11, 21], description="numbers of sections of IMM")
    slip_surfaces: list[str] = Field(
        [SEARCH], description="CSV files next to this one, or `search`"
    )

    @model_validator(mode="after")
    def _sensible(self) -> Alternatives:
        if any(not 0.5 <= factor <= 2.0 for factor in self.unit_weight_factors):
            raise ValueError("unit_weight_factors: each from 0.5 to 2")
        if any(not 0.0 <= share <= 1.0 for share in self.zif_shares):
            raise ValueError("zif_shares: each from 0 to 1")
        if any(number < 5 for number in self.sections):
            raise ValueError("sections: each at least 5")
        return self


class Judgement(Document):
    """One slide, and how it is looked at."""

    name: str = Field(min_length=1, description="of the slide, such as `upstream`")
    side: Side = Field(description="of the section to which the mass slid")
    slip_surface: str = Field(SEARCH, description="CSV next to this file (x_m, y_m), or `search`")
    slip_confidence: Confidence = Field("constructed", description="how far it may be trusted")
    head_x_m: float | None = Field(
        None, description="upper end of a slip surface that is searched; null: from the profile"
    )
    profile: str | None = Field(
        None, description="CSV of the surface after the slide; null: of the measurements"
    )
    water: Water = Field(
        "buoyant",
        description="weights less uplift, total weights with water pressures, or no water",
    )
    water_line: WaterLine = Field(
        "level",
        description="level: still water at pool level in the whole mass; phreatic: as in the scene",
    )
    unit_weight_factor: float = Field(1.0, ge=0.5, le=2.0, description="all densities times this")
    base_strength: BaseStrength = Field(
        "weaker",
        description="of the base: of what lay there (place), of what came (carried), or of the "
        "weaker of the two",
    )
    count_others: bool = Field(
        True, description="whether the strength of soil that did not liquefy counts"
    )
    method: Literal["spencer", "force", "ordinary"] = Field("spencer", description="of ZIF")
    zif_share: float = Field(0.45, ge=0, le=1, description="zero inertial factor of ZIF")
    sections: int = Field(11, ge=5, description="number of sections of IMM")
    path_end: EndSlope = Field("slip", description="end slope of the path of Kinetics")
    path_stages: Stages = Field(
        "varying", description="which section's weight and lengths Kinetics takes"
    )
    time_step_s: float = Field(0.01, gt=0, le=1, description="of Kinetics")
    published: list[str] = Field(
        default_factory=list,
        description="keys of strength_published_kpa that are about this slide; empty: all",
    )
    alternatives: Alternatives = Field(default_factory=Alternatives)


class Judgements(Document):
    """The whole of `classical.yaml`."""

    analyses: list[Judgement] = Field(min_length=1)

    @model_validator(mode="after")
    def _names_differ(self) -> Judgements:
        names = [analysis.name for analysis in self.analyses]
        for name in names:
            if names.count(name) > 1:
                raise ValueError(f"analyses: two are called {name!r}")
        return self


def load_judgements(folder: Path, measurements: Measurements) -> list[Judgement]:
    """The analyses of a case: from its file, or one per side with a measured runout.

    Raises:
        InputError: a file that does not hold together, or no runout that gives the side.
    """
    path = folder / FILE_NAME
    if not path.is_file():
        return default_judgements(measurements, str(folder))
    judgements = checked_document(Judgements, read_yaml(path), path, "docs/method/classical.md")
    known = set(measurements.strength_published_kpa)
    for analysis in judgements.analyses:
        for key in analysis.published:
            if key not in known:
                raise InputError(
                    f"{path}: {analysis.name}: published: {key!r} is not in the measurements' "
                    f"strength_published_kpa, which has {', '.join(sorted(known)) or 'none'}"
                )
    return judgements.analyses


def default_judgements(measurements: Measurements, source: str) -> list[Judgement]:
    """One analysis per side on which the default set has a runout.

    Raises:
        InputError: there is none.
    """
    toes = [m for m in measurements.chosen() if m.toe_side is not None and not m.censored]
    sides = {toe.toe_side for toe in toes if toe.values[0] > 0}
    if not sides:
        raise InputError(
            f"{source}: no toe_runout above 0 among the measurements; name the side of the slide "
            f"in {FILE_NAME}"
        )
    return [
        Judgement(
            name="upstream" if side == measurements.upstream else "downstream",
            side=side,
            # Behind the core the pool's level says nothing about the water in the soil.
            water_line="level" if side == measurements.upstream else "phreatic",
        )
        for side in sorted(sides)
    ]
