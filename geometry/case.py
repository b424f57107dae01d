"""A case: a folder read once, into one object with everything resolved.

In: a folder, or the name of a shipped case history, with `scene.yaml` and, where something was
measured, `measurements.yaml`; the settings. Out: a `Case`. What `inversion.yaml`, `diagnosis.yaml`
and `classical.yaml` ask is read by the packages that answer it; they extend the `Case`
(`inversion.back_analysis.case`, `inversion.prediction.prediction_case`, `diagnosis.case`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Protocol, TypeVar

from geometry.scenes.scene import Scene, load_scene, scene_from_mapping
from geometry.scenes3d.scene3d import is_body
from geometry.sides import SIDES, Side
from geometry.survey.blow_counts import BlowCount, load_blow_counts
from geometry.survey.marks import Mark
from geometry.survey.measured import Measured
from geometry.survey.measurements import FILE_NAME as MEASUREMENTS_FILE
from geometry.survey.measurements import Measurements, load_measurements
from pipeline.cli import InputError
from pipeline.config import Config, SimulationSettings
from pipeline.places import CASES, resolve

SCENE_FILE = "scene.yaml"

Extended = TypeVar("Extended", bound="Case")


class AsksResolution(Protocol):
    """A question that may ask for its own resolution and duration; None: it does not."""

    @property
    def spacing_m(self) -> float | None:
        """Of the material points [m]."""
        ...

    @property
    def duration_s(self) -> float | None:
        """Of the motion [s]."""
        ...


@dataclass(frozen=True)
class Case:
    """A section, its measurements, and the settings in force.

    Attributes:
        folder: of the case.
        config: settings in force.
        drawn: the section before the slide as its file has it.
        survey: all sets of measurements; None: nothing was measured.
        measurement_set: name of the set in use; empty: nothing was measured.
        scene: the section at the spacing in force.
        simulation: settings of the simulation, with the duration in force.
        own_spacing_m: the spacing that the folder asks for.
    """

    folder: Path
    config: Config
    drawn: Scene
    survey: Measurements | None
    measurement_set: str
    scene: Scene
    simulation: SimulationSettings
    own_spacing_m: float

    @property
    def name(self) -> str:
        """Name of the folder."""
        return self.folder.resolve().name

    @property
    def title(self) -> str:
        """The name in words."""
        return self.drawn.name.replace("_", " ").title()

    @property
    def measurements(self) -> Measurements:
        """All sets of measurements.

        Raises:
            InputError: the folder has none.
        """
        return load_measurements(self.folder) if self.survey is None else self.survey

    @property
    def measured(self) -> list[Measured]:
        """The measurements of the set in use; empty: nothing was measured."""
        return [] if self.survey is None else self.survey.chosen(self.measurement_set)

    @cached_property
    def feet(self) -> dict[Side, float]:
        """Where the section ends before the slide, x [m] by side: as surveyed, else as drawn."""
        if self.survey is None:
            return {side: self.scene.foot(side) for side in SIDES}
        return self.survey.feet(self.scene)

    @cached_property
    def blow_counts(self) -> dict[str, BlowCount]:
        """Zone -> its blow count; empty: the case has none.

        Raises:
            InputError: a file that does not hold together, or does not fit the scene; one line.
        """
        return load_blow_counts(self.folder, self.drawn)

    @property
    def marks(self) -> list[Mark]:
        """Marks of the measurements in a picture of the section."""
        return [mark for entry in self.measured for mark in entry.marks(self.feet)]

    def resolved(
        self,
        *questions: AsksResolution | None,
        spacing_factor: float = 1.0,
        spacing_m: float | None = None,
    ) -> Case:
        """The case at the spacing and for the duration that its questions ask for.

        Args:
            questions: the first that states a spacing decides it, and so for the duration; where
                none does, the section and the settings do.
            spacing_factor: of the spacing.
            spacing_m: wins over all of these, and is not multiplied.

        Raises:
            InputError: the section is not available at that spacing; one line.
        """
        asked = [question for question in questions if question is not None]
        own = next((q.spacing_m for q in asked if q.spacing_m is not None), self.drawn.spacing)
        spacing = own * spacing_factor if spacing_m is None else spacing_m
        scene = self.drawn
        if spacing != scene.spacing:
            document = {**scene.model_dump(), "spacing": spacing}
            source = f"{self.folder / SCENE_FILE} at {spacing:g} m spacing"
            scene = scene_from_mapping(document, source)
        simulation = self.config.simulation
        duration = next((q.duration_s for q in asked if q.duration_s is not None), None)
        if duration is not None:
            simulation = simulation.model_copy(update={"duration_s": duration})
        return replace(self, scene=scene, simulation=simulation, own_spacing_m=own)

    def changed(self, *, water: bool = True, strengths: Mapping[str, float] | None = None) -> Case:
        """The case with another section.

        Args:
            water: False takes the reservoir and the groundwater away.
            strengths: material -> cohesion, which is S_r where it liquefied [kPa]; it replaces a
                strength ratio.

        Raises:
            InputError: there is no such material, or the section does not hold together; one line.
        """
        document = self.scene.model_dump()
        if not water:
            document["water_level"] = None
        for name, cohesion in (strengths or {}).items():
            if name not in document["materials"]:
                known = ", ".join(document["materials"])
                raise InputError(
                    f"strengths: {self.drawn.name} has no material {name!r}; it has {known}"
                )
            document["materials"][name]["cohesion_kpa"] = cohesion
            document["materials"][name].pop("strength_ratio", None)
        scene = scene_from_mapping(document, f"{self.folder / SCENE_FILE} with the options given")
        return replace(self, scene=scene)

    def with_set(self, name: str | None) -> Case:
        """The case with another set of measurements in use; None: the same.

        Raises:
            InputError: there is no such set, or the folder has no measurements.
        """
        self.measurements.chosen(name)
        return self if name is None else replace(self, measurement_set=name)

    def extended(self, kind: type[Extended], **more: Any) -> Extended:
        """The same case with what a question adds to it: a subclass and its own fields."""
        return kind(**{one.name: getattr(self, one.name) for one in fields(Case)}, **more)


def load_case(place: str | Path, config: Config | None = None) -> Case:
    """Read a case.

    Args:
        place: its folder, its name in `case_histories` here or as shipped, or its `scene.yaml`.
        config: settings; None: the defaults.

    Raises:
        InputError: no such folder or scene, a body in three dimensions, or a document that does not
            hold together; one line with file, field, value and what is allowed.
    """
    folder, config = resolve(place, CASES), config or Config()
    if folder.name == SCENE_FILE and folder.is_file():
        folder = folder.parent
    if folder.exists() and is_body(folder):
        raise InputError(
            f"{folder}: a body in three dimensions; this takes a section ({SCENE_FILE})"
        )
    if not folder.is_dir():
        raise InputError(
            f"{folder}: no such folder; a case has {SCENE_FILE}, and {MEASUREMENTS_FILE} and "
            "inversion.yaml where there is something to fit"
        )
    scene = load_scene(folder / SCENE_FILE)
    survey = None
    if (folder / MEASUREMENTS_FILE).is_file():
        survey = load_measurements(folder, scene)
    chosen = "" if survey is None else survey.default_set
    return Case(folder, config, scene, survey, chosen, scene, config.simulation, scene.spacing)
