"""`no_flow`: the toe moved less than a limit; nothing ran, and how far it moved is not known.

A censored observation. In a least-squares fit it contributes nothing while the predicted runout is
below the limit, and the excess otherwise; its likelihood is Phi((limit - predicted) / std), with
the error of the model (`inversion.posterior.likelihood`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Literal, Self

import numpy as np
from pydantic import Field

from geometry.scenes.scene import Scene
from geometry.sides import Side, outward_of
from geometry.survey.marks import Distance, Mark
from geometry.survey.measured import Deposit, Length
from geometry.survey.site import Site
from geometry.survey.toe_runout import (
    check_has_toe,
    check_toe_in_domain,
    runout_by_eye,
    runout_of,
)


class NoFlow(Length):
    """The toe moved less than `limit_m` beyond the foot of the section, on one side."""

    history: ClassVar[None] = None
    along: ClassVar[None] = None
    datum: ClassVar[None] = None
    censored: ClassVar[bool] = True

    type: Literal["no_flow"]
    side: Side = Field(description="left or right of the section")
    limit_m: float = Field(
        gt=0, description="outward movement of the toe that would have been a flow slide [m]"
    )

    @property
    def values(self) -> np.ndarray:
        """The limit, (1,) [m]."""
        return np.array([self.limit_m])

    def with_values(self, values: np.ndarray) -> Self:
        """The same with another limit, (1,) [m]."""
        return self.model_copy(update={"limit_m": float(values[0])})

    @property
    def toe_side(self) -> Side:
        """The side of the toe."""
        return self.side

    def read_points(self, deposit: Deposit, *, derivative: bool) -> Any:
        """Movement of the toe outward [m], also below the limit.

        From the toe of the same points before the slide, not from the foot of the section: a gentle
        foot reads short by metres before anything moves, and nothing that stood may count as moved.
        """
        start = self._toe_before(deposit)
        return runout_of(deposit, self.side, start=start, derivative=derivative)

    def by_eye(self, deposit: Deposit) -> float:
        """Movement of the outermost connected point [m]."""
        before = runout_by_eye(deposit.before, self.side, 0.0)
        return runout_by_eye(deposit, self.side, 0.0) - before

    def _toe_before(self, deposit: Deposit) -> float:
        """Place of the same points' toe before the slide, x [m]."""
        return outward_of(self.side) * runout_of(deposit.before, self.side, start=0.0)

    def check_in(self, scene: Scene, feet: Mapping[Side, float], where: str) -> None:
        """A limit on a side that has a toe, within walls; open ones give way."""
        check_has_toe(scene, self.side, where)
        end = feet[self.side] + outward_of(self.side) * self.limit_m
        check_toe_in_domain(end, scene, self.side, f"{where}: limit_m")

    @classmethod
    def could_be_made(cls, site: Site) -> Sequence[NoFlow]:
        """None: a `toe_runout` says more."""
        return []

    def marks(self, feet: Mapping[Side, float]) -> Sequence[Mark]:
        """A dimension line from the foot to the limit."""
        return [Distance(feet[self.side], outward_of(self.side), self.limit_m, None, limit=True)]
