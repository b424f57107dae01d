"""From the strength that a run needs to the one in ever smaller cells.

A slide of cells h runs less far than the soil would, so the strength that is found with it is too
low. What the cell costs falls as c h^1.45 (docs/method/inversion.md#small-cells). Two spacings tell
how much it is: with points k h apart, all strengths times one factor q leave the deposit that those
h apart leave, and

    ln(S / S_h) = -ln q / (k^1.45 - 1),

S in small cells, S_h by runs. Where no second spacing can be had, or the law does not hold between
the two (they lie far apart, larger cells ask for more strength, or the runs scatter by more than
cells cost), nothing is taken off and the strength is less certain.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import TypeVar

import numpy as np
from pydantic import Field

from geometry.scenes.doubts import ROWS, fewest_rows
from geometry.scenes.scene import Scene
from geometry.scenes3d.scene3d import Scene3d
from inversion.engines.registry import Engine
from inversion.engines.run_store import Store
from inversion.estimation.forward import (
    Forward,
    Prediction,
    Request,
    SectionSetup,
    Setup,
    WrappedEngine,
)
from inversion.estimation.unknowns import Parameters
from pipeline.cli import InputError
from pipeline.documents import StrictDocument

AnySetup = TypeVar("AnySetup", bound=Setup)

NAME = "cell size"
"""Of the cells among the sources of uncertainty, and where a line is of them."""

#: Power of the cell with which strengths approach their limit, of 60 random dams.
ORDER = 1.45
#: Standard deviation of ln(S / S_h): a share of it, and the least that the noise of runs leaves.
SHARE_STD, NOISE_STD = 0.5, 0.01
#: The same where it is not known: the dams' own spread about no correction, with so many spacings
#: in their height; with fewer it grows as what the cells cost.
UNKNOWN_STD, USUAL_SPACINGS = 0.06, 20.0
#: What `ROWS` of points in a liquefied layer cost where it is not known, and the power of the cell
#: with which it grows: 0.04 to 0.6 of six layers of the gallery with four rows, 1.5 of another
#: levee, 0.01 to 0.2 with five, 0.7 to more than 1.1 with two, and no smooth law between them. At
#: most so much.
ROWS_STD, ROWS_ORDER, MOST_BY_ROWS = 0.5, 4.0, 1.0
#: Beyond this ln(S / S_h) the cells are too large for the law.
FARTHEST = 0.25
#: What a second spacing tells is checked by a third; so many standard deviations apart, the nearer
#: of the two counts, and is off by as much as they differ.
FAR_APART = 2.0
#: Other spacings over that of the runs, in the order in which they are tried: coarse runs are
#: cheap. Fewer points than this make no slide.
OTHER_SPACINGS, LEAST_POINTS = (2.0, 1.5, 0.6), 200
#: ln q of the first runs, distances of the others from where these say it is, of coarse runs and
#: of fine ones, which are dear; the largest that is looked for.
FIRST, NEAR_COARSE, NEAR_FINE, MOST_LOG = (
    (0.0, -0.1),
    (-0.075, -0.025, 0.025, 0.075),
    (-0.05, 0.05),
    0.6,
)
#: Each of these runs has its points elsewhere, by up to this share of half a spacing.
JITTER = 0.5
#: Standard deviations of the survey by which a factor of e must move the numbers, to be noticed.
LEAST_SLOPE = 0.1


class SmallCells(StrictDocument):
    """What the size of the cells makes of the strengths of a run."""

    factor: float = Field(1.0, description="strength in small cells / strength that a run needs")
    log_std: float = Field(description="standard deviation of its logarithm")
    spacing_m: float = Field(description="between the points of the runs")
    other_spacing_m: float | None = Field(
        None, description="of the runs that it was found with; null: it is not known"
    )
    words: str = Field(description="how it was found, or why not")
    runs: int = Field(0, description="simulations that this took, kept ones included")

    @classmethod
    def unknown(
        cls, scene: Scene | Scene3d, why: str, *, seen: float = 0.0, runs: int = 0
    ) -> SmallCells:
        """Nothing is taken off; strengths are less certain.

        Args:
            scene: of the runs.
            why: it is not known.
            seen: ln of the strength by which two spacings differ all the same.
            runs: that this took.
        """
        doubt = max(usual_doubt(scene), seen)
        words = f"{NAME}: not known: {why}"
        return cls(log_std=doubt, spacing_m=scene.spacing, words=words, runs=runs)

    @property
    def known(self) -> bool:
        """Two spacings have told the factor."""
        return self.other_spacing_m is not None

    def factors(self, parameters: Parameters, shares: np.ndarray | float = 1.0) -> np.ndarray:
        """Values in small cells over those of runs, (p,); 1 where they are no strength.

        Args:
            parameters: p of them.
            shares: of each prior's variance that the data take off, (p,): what a prior says of a
                strength, the cells do not change.
        """
        return np.where(parameters.strengths, self.factor**shares, 1.0)


def usual_doubt(scene: Scene | Scene3d) -> float:
    """Standard deviation of ln(S / S_h) of a section whose cells nobody has asked about."""
    spacings = max(scene.sliding_height / scene.spacing, 1.0)
    doubt = min(UNKNOWN_STD * max(USUAL_SPACINGS / spacings, 1.0) ** ORDER, MOST_LOG)
    if isinstance(scene, Scene):
        by_rows = ROWS_STD * (ROWS / fewest_rows(scene)) ** ROWS_ORDER
        doubt = max(doubt, min(by_rows, MOST_BY_ROWS))
    return doubt


def other_spacings(
    setup: AnySetup, points: int, dimensions: int, source: str, asked: Sequence[float] = ()
) -> Iterator[AnySetup]:
    """A setup at other spacings, in the order in which they are tried.

    None of them has fewer than `ROWS` of points in a liquefied layer: below, the law does not hold.

    Args:
        setup: with the spacing that is asked about.
        points: of it.
        dimensions: 2; of 3 a run takes minutes, so only what is asked for.
        source: file of the question, for messages.
        asked: spacings over that of the setup that come first.
    """
    more = OTHER_SPACINGS if dimensions == 2 else ()
    for factor in dict.fromkeys((*asked, *more)):
        if points / factor**dimensions < LEAST_POINTS and factor not in asked:
            continue
        try:
            other = setup.at_spacing(factor * setup.scene.spacing, source)
        except InputError:  # a zone would be too thin
            continue
        if not (isinstance(other, SectionSetup) and fewest_rows(other.scene) < ROWS):
            yield other


def cells_by(
    engine: Engine, store: Store, setup: Setup, values: np.ndarray, others: Iterable[Setup]
) -> SmallCells:
    """What the cells of an engine's runs make of the strengths of a setup.

    Of a section between flanks plane runs tell it, at a hundredth of the time.

    Args:
        engine: whose runs they are.
        store: of its runs.
        setup: with the spacing that is asked about.
        values: of its parameters, (p,).
        others: the same at other spacings, in the order in which they are tried.
    """
    ahead = iter(others)
    first = next(ahead, None)
    if first is not None and engine.unseen is not None and isinstance(setup, SectionSetup):
        assert isinstance(first, SectionSetup)
        if reason := engine.unseen(setup, first):
            return SmallCells.unknown(setup.scene, reason)
    there = () if first is None else (first,)
    return small_cells(engine.made(store.of_cells), setup, values, chain(there, ahead))


def small_cells(
    engine: Forward, setup: Setup, values: np.ndarray, others: Iterable[Setup]
) -> SmallCells:
    """What the cells make of the strengths of a setup.

    Args:
        engine: simulates all of them.
        setup: with the spacing that is asked about.
        values: of its parameters, (p,).
        others: the same at other spacings, in the order in which they are tried.
    """
    spacing, seen, before = setup.scene.spacing, 0.0, engine.runs
    why, told = "no other spacing can be run", None
    usual = usual_doubt(setup.scene)
    for other in others:
        there = other.scene.spacing
        if told is not None and there < spacing:
            break  # finer runs are too dear to check what coarse ones have told
        found = same_slide(engine, setup, values, other)
        if found is None:
            why = f"no run {there:g} m apart leaves the same slide"
            continue
        reach = (there / spacing) ** ORDER - 1.0
        distance, noise = -found.log / reach, found.noise / abs(reach)
        if noise > usual:
            why = f"runs {spacing:g} and {there:g} m apart scatter by more than cells usually cost"
            continue
        apart = 0.0
        if told is not None:
            apart = abs(distance - told.distance)
            if apart <= FAR_APART * np.hypot(noise, told.noise):
                break
            told = None
        if -max(noise, NOISE_STD) <= distance <= FARTHEST:
            told = _Told(distance, float(np.hypot(noise, apart)), there)
            if apart:
                break
            continue
        seen, differ = max(abs(distance), apart), 100.0 * abs(np.expm1(found.log))
        if distance < 0.0:
            seen *= SHARE_STD  # of far flows a half or less was true
            why = (
                f"runs {there:g} m apart ask for {differ:.0f} % {'more' if reach > 0 else 'less'} "
                f"strength than those {spacing:g} m apart, against the law: a smaller spacing "
                "would tell"
            )
            break  # another that obeys it would be chosen for that
        why = (
            f"runs {spacing:g} and {there:g} m apart differ by {differ:.0f} % in strength, too "
            "much to go on from: a smaller spacing would tell"
        )
    runs = engine.runs - before
    if told is None:
        return SmallCells.unknown(setup.scene, why, seen=seen, runs=runs)
    return SmallCells(
        factor=float(np.exp(told.distance)),
        log_std=float(np.hypot(SHARE_STD * told.distance, max(told.noise, NOISE_STD))),
        spacing_m=spacing,
        other_spacing_m=told.spacing_m,
        words=f"{NAME}: from runs {spacing:g} and {told.spacing_m:g} m apart",
        runs=runs,
    )


@dataclass(frozen=True)
class _Told:
    """ln(S / S_h) by a second spacing, and its standard deviation by the noise of the runs."""

    distance: float
    noise: float
    spacing_m: float


@dataclass(frozen=True)
class SameSlide:
    """ln q with which the strengths at another spacing leave the slide of a setup, and its noise.

    Attributes:
        log: ln q.
        noise: its standard deviation by the place of the points, at both spacings.
    """

    log: float
    noise: float


def same_slide(engine: Forward, setup: Setup, values: np.ndarray, other: Setup) -> SameSlide | None:
    """The strengths of another setup that leave the slide of a setup.

    By straight lines through the fitted numbers of a few runs, weighed by their errors. What the
    runs scatter by about the lines is the noise; at the spacing of the setup it is in proportion to
    the spacing. None: runs failed, or nothing moves with the strength.
    """
    strengths, targets = setup.parameters.strengths, setup.targets
    (here,) = engine.predict([setup.at(values)])
    counted = targets.fitted & ~targets.censored
    weight = np.where(counted, 1.0 / np.sqrt(np.diag(targets.covariance)), 0.0)
    if not counted.any() or not np.isfinite(here.values[counted]).all():
        return None
    ratio = setup.scene.spacing / other.scene.spacing
    logs: list[float] = []
    found: list[Prediction] = []
    where = scatter = 0.0
    for more in (FIRST, NEAR_COARSE if ratio < 1.0 else NEAR_FINE):
        places = [where + one for one in more]
        requests = [
            other.jittered(JITTER, seed).at(np.where(strengths, values * np.exp(log), values))
            for seed, log in enumerate(places, start=len(logs) + 1)
        ]
        logs += places
        found += engine.predict(requests)
        off = np.array([weight * (one.values - here.values) for one in found])
        off = off[:, np.isfinite(off).all(axis=0) & counted]
        away, mean = np.array(logs) - np.mean(logs), off.mean(axis=0)
        slope = away @ off / (away @ away)
        size = float(np.linalg.norm(slope))
        if not size >= LEAST_SLOPE:
            return None
        along = slope / size
        where = float(np.clip(np.mean(logs) - along @ mean / size, -MOST_LOG, MOST_LOG))
        left = (off - mean - away[:, None] * slope) @ along
        scatter = float(np.sqrt(left @ left / max(len(logs) - 2, 1))) / size
    return SameSlide(where, scatter * float(np.sqrt(1.0 / len(logs) + ratio**2)))


@dataclass
class InSmallCells(WrappedEngine):
    """An engine that is asked for strengths in small cells, and runs those that its cells need.

    Attributes:
        engine: of the runs.
        cells: of its runs.
    """

    engine: Forward
    cells: SmallCells

    def predict(self, requests: Sequence[Request]) -> list[Prediction]:
        """Predictions of the engine inside."""
        return self.engine.predict([self._ran(request) for request in requests])

    def error_std(self, request: Request) -> np.ndarray:
        """See `Forward`."""
        return self.engine.error_std(self._ran(request))

    def _ran(self, request: Request) -> Request:
        setup = request.setup
        return setup.at(request.values / self.cells.factors(setup.parameters))
