"""What another reading of a question may change: water, base, soil, the simulation.

In: entries of `inversion.yaml`. Out: checked documents; `inversion.back_analysis.variants` makes
setups of them.
"""

from __future__ import annotations

import builtins
from collections.abc import Mapping
from typing import Any, Literal

from pydantic import Field, ValidationError, model_validator

from geometry.scenes.scene import Document
from pipeline.config import SimulationSettings, describe_error

Water = Literal["none", "buoyant", "pore_pressure"]
WATER_WORDS = {
    "buoyant": "reduced weight alone",
    "pore_pressure": "pressure in and on the soil",
}
"""How each `simulation.water` reads after "water as"."""
Contact = Literal["rough", "no_slip"]


def check_simulation(changes: Mapping[str, Any]) -> None:
    """Refuse settings of the simulation that do not exist or values that they cannot have."""
    try:
        SimulationSettings.model_validate(changes)
    except ValidationError as error:
        raise ValueError(f"simulation: {describe_error(error, SimulationSettings)}") from None


class OtherProperty(Document):
    """Another value of one property of the soil in some zones."""

    zones: list[str] = Field(default_factory=list, description="names of zones; none: all")
    property: Literal["cohesion_kpa", "friction_deg", "density"] = Field(
        description="cohesion_kpa, friction_deg or density"
    )
    value: float | None = Field(
        description="in the property's unit; null: as in scene.yaml, whatever a step before said"
    )


class Changes(Document):
    """How a reading differs; what is left out stays as it is."""

    water: Water | None = Field(None, description="none, buoyant or pore_pressure; null: as it is")
    pool_level_m: float | None = Field(None, description="level of the pool [m]; null: as it is")
    contact: Contact | None = Field(None, description="contact with the base; null: as it is")
    simulation: dict[str, Any] = Field(
        default_factory=dict, description="settings of the simulation that differ"
    )
    properties: list[OtherProperty] = Field(
        default_factory=list, description="of soil that is not calibrated"
    )
    zones: dict[str, list[str]] = Field(
        default_factory=dict,
        description="parameter -> zones that share it instead, with the soil of its first zone",
    )

    @model_validator(mode="after")
    def _settings_exist(self) -> Changes:
        check_simulation(self.simulation)
        return self

    @builtins.property
    def changed(self) -> bool:
        """Something is different."""
        return any(getattr(self, name) not in (None, {}, []) for name in Changes.model_fields)


class WaterfallStep(Changes):
    """One change on the way from another reading to the question, on top of those before it."""

    name: str = Field(min_length=1, description="in words; unique in the waterfall")
    case: str | None = Field(
        None,
        description="the section, survey and unknown of another case from here on: a folder next "
        "to this one; its own name: of this case. Changes of the soil before it end here",
    )


class StatedValue(Document):
    """A value that somebody else found, where a waterfall begins."""

    name: str = Field(min_length=1, description="in words")
    value: float = Field(description="in the parameter's unit")
    source: str = Field(min_length=1, description="where it is written")


class Waterfall(Document):
    """How one parameter gets from another reading to that of the question, change by change."""

    parameter: str | None = Field(None, description="name of the parameter; null: the first")
    stated: StatedValue | None = Field(None, description="the first bar; null: none")
    steps: list[WaterfallStep] = Field(min_length=1, description="in order, each solved")

    @model_validator(mode="after")
    def _names_are_unique(self) -> Waterfall:
        names = [step.name for step in self.steps]
        for name in names:
            if names.count(name) > 1:
                raise ValueError(f"steps: two are called {name!r}; names must be unique")
        return self


def on_top(before: Changes, step: WaterfallStep) -> Changes:
    """The changes of a step with those before it: of a zone the last one holds."""
    fresh = step.case is not None
    soil = [] if fresh else before.properties
    for one in step.properties:
        left = (_without(other, one) for other in soil)
        soil = [*(other for other in left if other is not None), one]
    return Changes(
        water=step.water or before.water,
        pool_level_m=before.pool_level_m if step.pool_level_m is None else step.pool_level_m,
        contact=step.contact or before.contact,
        simulation={**before.simulation, **step.simulation},
        properties=soil,
        zones={**({} if fresh else before.zones), **step.zones},
    )


def _without(before: OtherProperty, after: OtherProperty) -> OtherProperty | None:
    """What an earlier change still says after a later one; None: nothing.

    A change of all zones cannot lose some of them, so it stays, before the later one.
    """
    if before.property != after.property:
        return before
    if not after.zones:
        return None
    if not before.zones:
        return before
    left = [zone for zone in before.zones if zone not in after.zones]
    return before.model_copy(update={"zones": left}) if left else None
