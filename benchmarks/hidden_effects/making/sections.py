"""The sections of the benchmark: a scene, what is calibrated on it, and where it is surveyed.

In: a folder with `scene.yaml`, `inversion.yaml` and `survey.yaml`. Out: a `Section`.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydantic import Field

from geometry.scenes.scene import (
    Document,
    Point,
    Scene,
    checked_document,
    load_scene,
)
from geometry.sides import Side
from inversion.estimation.unknowns import Parameters
from inversion.problem.question import Question, load_question
from pipeline.cli import InputError
from pipeline.files import read_yaml
from pipeline.random_numbers import Stream

SURVEY_FILE = "survey.yaml"


class ProfilePlan(Document):
    """Where the surface is surveyed: from near the toe to a place that hardly moves."""

    points: int = Field(ge=8, description="number of places, equally spaced")
    to_x_m: float = Field(description="the last place [m]; the first lies just inside the toe")
    correlation_length_m: float = Field(gt=0, description="of the survey's errors [m]")


class SurveyPlan(Document):
    """The whole of `survey.yaml`."""

    side: Side = Field(description="where the slide runs to")
    profile: ProfilePlan = Field(description="of the final surface")
    markers_m: list[Point] = Field(min_length=1, description="places before the slide")
    history_times_s: list[float] = Field(min_length=1, description="at which the toe is seen")
    runouts_m: tuple[float, float] = Field(
        description="least and largest runout of a truth [m]: what runs less is not a flow slide"
    )
    strengths_kpa: dict[str, tuple[float, float]] = Field(
        description="parameter without prior -> range of the truths, drawn in the logarithm"
    )


@dataclass(frozen=True)
class Section:
    """A section, the question asked of it, and its survey.

    Attributes:
        folder: of its files.
        scene: at the spacing of the diagnosing model.
        question: the calibrated parameters.
        survey: where it is surveyed.
    """

    folder: Path
    scene: Scene
    question: Question
    survey: SurveyPlan

    @property
    def name(self) -> str:
        """Name of the folder."""
        return self.folder.name

    @property
    def parameters(self) -> Parameters:
        """The calibrated parameters."""
        return Parameters(self.question.parameters)

    def draw(self, stream: Stream) -> np.ndarray:
        """True parameters (p,) in outside units: from the priors, or from the range of truths."""
        values = []
        for spec in self.question.parameters:
            if spec.prior is None:
                low, high = self.survey.strengths_kpa[spec.name]
                values.append(float(np.exp(stream.uniform(np.log(low), np.log(high)))))
            else:
                drawn = spec.prior.mean + spec.prior.std * normal(stream)
                values.append(float(np.clip(drawn, spec.low, spec.high)))
        return np.array(values)

    def typical(self, level: float) -> np.ndarray:
        """Parameters (p,): priors at their means, the others at a share of their range."""
        values = []
        for spec in self.question.parameters:
            if spec.prior is None:
                low, high = self.survey.strengths_kpa[spec.name]
                values.append(float(low ** (1.0 - level) * high**level))
            else:
                values.append(spec.prior.mean)
        return np.array(values)


def normal(stream: Stream) -> float:
    """A standard normal number (Box and Muller 1958)."""
    radius = np.sqrt(-2.0 * np.log(1.0 - stream.unit()))
    return float(radius * np.cos(2.0 * np.pi * stream.unit()))


def load_section(folder: str | Path) -> Section:
    """Read a section.

    Raises:
        InputError: a file is missing, or one that does not hold together; one line.
    """
    folder = Path(folder)
    scene = load_scene(folder / "scene.yaml")
    question = load_question(folder, scene)
    path = folder / SURVEY_FILE
    survey = checked_document(SurveyPlan, read_yaml(path), path)
    for spec in question.parameters:
        if spec.prior is None and spec.name not in survey.strengths_kpa:
            raise InputError(f"{path}: strengths_kpa: {spec.name}: missing, it has no prior")
    return Section(folder, scene, question, survey)
