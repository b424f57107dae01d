"""What a case and its question are to a back-analysis, on a section or on a body."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar, TypeVar

import numpy as np

from geometry.scenes.doubts import thin_layers
from geometry.survey.sets import Sets
from inversion.back_analysis.variants import Changed, sides, vary
from inversion.engines.small_cells import other_spacings
from inversion.estimation.data import Targets, make_targets
from inversion.estimation.forward import SectionSetup, Setup
from inversion.estimation.misfit import Objective
from inversion.estimation.unknowns import Parameters
from inversion.problem.question import FILE_NAME, CellSize, Question, Sensitivity, Variant
from pipeline.cli import InputError
from pipeline.config import Config

AnySetup = TypeVar("AnySetup", bound=Setup)
Sides = list[tuple[Sensitivity, list[Changed[Any]]]]
"""Sensitivities with their setups."""

#: Coarse runs are no guide where a liquefied layer has fewer rows of points: with two, S_r of a dam
#: on a thin base is 2 to 2.5 times too low.
GUIDING_ROWS = 2.25


class Asked(ABC):
    """A case and the question asked of it.

    Attributes:
        folder: of the case.
        config: settings in force.
        measurement_set: name of the set in use.
        question: as in the file.
        setup: the question as the engine takes it.
        own_spacing_m: the spacing that the folder asks for.
        use_constructed: constructed data may enter the fit.
    """

    folder: Path
    config: Config
    measurement_set: str
    question: Question
    setup: Setup
    own_spacing_m: float
    use_constructed: bool

    #: Of the space that its points fill.
    dimensions: ClassVar[int]

    @property
    @abstractmethod
    def name(self) -> str:
        """Name of the folder."""

    @property
    @abstractmethod
    def title(self) -> str:
        """The name in words."""

    @property
    @abstractmethod
    def measurements(self) -> Sets:
        """All sets of measurements."""

    @property
    @abstractmethod
    def point_count(self) -> int:
        """Material points at the spacing in force."""

    @property
    def source(self) -> str:
        """File of the question, for messages."""
        return str(self.folder / FILE_NAME)

    @property
    def parameters(self) -> Parameters:
        """The unknown parameters."""
        return self.setup.parameters

    @property
    def spacing_m(self) -> float:
        """Of the material points, in force [m]."""
        return self.setup.scene.spacing

    def objective(self, setup: Setup | None = None) -> Objective:
        """The objective to minimise, for the question or another reading of it."""
        settings, loss = self.config.inversion, self.question.loss
        chosen = self.setup if setup is None else setup
        targets = chosen.targets
        if limit := targets.limits_alone:
            loss = "runout"  # the limit is to be met, however well the movement is known
        tolerance = settings.tolerance_misfit
        if loss == "runout":  # in a flume a runout is decimetres, and a survey's error less
            variances = np.diag(targets.covariance)[targets.fitted]
            tolerance = min(settings.tolerance_m2, float(variances.sum()))
        return Objective(chosen.parameters, targets, loss, tolerance, limit=limit)

    def jittered(self, setup: AnySetup, seed: int) -> AnySetup:
        """The same setup with its points jittered by a seed."""
        return setup.jittered(self.config.inversion.noise_jitter, seed)

    # --- two spacings ---

    @cached_property
    def coarse_spacing_m(self) -> float | None:
        """Spacing of coarse runs [m]; None: every run is at the spacing in force.

        The same holds where the settings ask for no coarser spacing, or at it there would be few
        points, a zone that is too thin, or a liquefied layer of so few rows of points that its
        strength is off by a factor of two. `inversion.coarse_points` are of a section; a body has
        as many along each of its edges.
        """
        settings = self.config.inversion
        spacing = settings.coarse_factor * self.own_spacing_m
        points = self.point_count * (self.spacing_m / spacing) ** self.dimensions
        if spacing <= self.spacing_m or points < settings.coarse_points ** (self.dimensions / 2):
            return None
        coarse = self.at_spacing(spacing, self.setup)
        if coarse is None:
            return None
        lost = isinstance(coarse, SectionSetup) and thin_layers(coarse.scene, GUIDING_ROWS)
        return None if lost else spacing

    def coarsened(self, setup: AnySetup) -> AnySetup | None:
        """The same setup at the coarse spacing.

        None: there is no such spacing, the setup asks for a spacing of its own, or one of its zones
        would be too thin.
        """
        if self.coarse_spacing_m is None or setup.scene.spacing != self.spacing_m:
            return None
        return self.at_spacing(self.coarse_spacing_m, setup)

    def at_spacing(self, spacing: float, setup: AnySetup) -> AnySetup | None:
        """The same setup at another spacing [m]; None: one of its zones would be too thin."""
        try:
            return setup.at_spacing(spacing, self.source)
        except InputError:
            return None

    # --- small cells ---

    def other_cells(self, setup: AnySetup) -> Iterator[AnySetup]:
        """A setup at other spacings, to tell what its cells make of it; the asked ones first."""
        asked = [one.factor for one in self.question.sensitivities if isinstance(one, CellSize)]
        return other_spacings(setup, self.point_count, self.dimensions, self.source, asked)

    # --- other readings ---

    def variant(self, variant: Variant) -> Changed[Any]:
        """The setup of a variant.

        Raises:
            InputError: the case does not have what it changes.
        """
        targets = self.setup.targets
        if variant.measurements is not None or variant.fit is not None:
            name = variant.measurements or self.measurement_set
            fit = variant.fit
            if fit is None:
                fit = fit_of(self.question, self.measurements, name)
            targets = self.targets_of(name, fit)
        return vary(self.setup, variant, targets, self.source)

    def variants_of(self, refused: Callable[[Setup], str]) -> tuple[list[Variant], list[str]]:
        """The variants that are not refused, and lines about the others.

        Args:
            refused: why a setup cannot be simulated; empty: it can.
        """
        kept, reasons = [], []
        for variant in self.question.variants:
            reason = self.lacks(variant) or refused(self.variant(variant).setup)
            if reason:
                reasons.append(f"{variant.name}: left out: {reason}")
            else:
                kept.append(variant)
        return kept, reasons

    def lacks(self, entry: Variant | Sensitivity) -> str:
        """What such a case does not have of what an entry changes; empty: it has all."""
        return ""

    @cached_property
    def sensitivities(self) -> tuple[Sides, list[str]]:
        """The sensitivities with their setups, and lines about those that are not available.

        At a coarser spacing than the case asks for, a change may leave a zone thinner than a
        spacing; that is not a mistake in the question, so the sensitivity is left out and reported.
        """
        found: Sides = []
        left_out: list[str] = []
        for entry in self.question.sensitivities:
            if reason := self.lacks(entry):
                left_out.append(f"{entry.name}: left out: {reason}")
                continue
            try:
                changed = sides(self.setup, entry, self.source)
                if not isinstance(entry, CellSize):  # which is taken off the answer: `other_cells`
                    found.append((entry, changed))
            except InputError as error:
                if self.spacing_m <= self.own_spacing_m:
                    raise
                reason = str(error).removeprefix(f"{self.source}: sensitivities: ")
                left_out.append(f"left out at {self.spacing_m:g} m spacing: {reason}")
        return found, left_out

    def sensitivities_of(self, refused: Callable[[Setup], str]) -> tuple[Sides, list[str]]:
        """The sensitivities without those that are refused, and lines about what is left out.

        Args:
            refused: why a setup cannot be simulated; empty: it can.
        """
        entries, left_out = self.sensitivities
        kept: Sides = []
        reasons = list(left_out)
        for entry, changed in entries:
            reason = next(filter(None, (refused(side.setup) for side in changed)), "")
            if reason:
                reasons.append(f"{entry.name}: left out: {reason}")
            else:
                kept.append((entry, changed))
        return kept, reasons

    def fitted_to(self, names: Sequence[str]) -> Targets[Any]:
        """The measurements in use, with others fitted, by name."""
        return self.targets_of(self.measurement_set, names)

    def targets_of(self, measurement_set: str, fit: Sequence[str] | None) -> Targets[Any]:
        """The measurements of a set.

        Args:
            measurement_set: its name.
            fit: names of those to fit; None: all that may be.
        """
        return make_targets(
            self.measurements.chosen(measurement_set),
            fit=fit,
            loss=self.question.loss,
            source=self.source,
            use_constructed=self.use_constructed,
        )


def fit_of(question: Question, measurements: Sets, chosen: str) -> list[str] | None:
    """`fit` speaks of the default set; another set is fitted by the same names if it has any."""
    if question.fit is None or chosen == measurements.default_set:
        return question.fit
    there = {entry.name for entry in measurements.chosen(chosen)}
    kept = [name for name in question.fit if name in there]
    return kept or None
