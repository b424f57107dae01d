"""Sets of measurements by name, of which one is used: what such documents have in common."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Self

from pydantic import model_validator

from geometry.scenes.scene import Document
from pipeline.cli import InputError


class Sets(Document):
    """Base of a document with sets of measurements, in the fields `sets` and `default_set`."""

    if TYPE_CHECKING:
        case: str
        default_set: str
        sets: dict[str, list[Any]]
        strength_published_kpa: dict[str, dict[str, Any]]

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.default_set not in self.sets:
            raise ValueError(f"default_set: {self.default_set!r} is none of {', '.join(self.sets)}")
        for group, entries in self.sets.items():
            if not entries:
                raise ValueError(f"sets.{group}: holds no measurement")
            names = [entry.name for entry in entries]
            for name in names:
                if names.count(name) > 1:
                    raise ValueError(f"sets.{group}: two measurements are called {name!r}")
        return self

    def chosen(self, name: str | None = None) -> list[Any]:
        """The measurements of a set; None: of the default one.

        Raises:
            InputError: there is no such set.
        """
        wanted = self.default_set if name is None else name
        if wanted not in self.sets:
            raise InputError(
                f"{self.case}: no set of measurements {wanted!r}; there are {', '.join(self.sets)}"
            )
        return list(self.sets[wanted])
