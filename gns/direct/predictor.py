"""A trained direct model that answers: plain arrays in and out.

In: a `SectionColumns` and its toes before the slide. Out: a `Forecast` with intervals that cover
nine of ten runs it was calibrated on, its derivative with respect to the strengths of the zones,
and how far the section lies from those that the model has learned from. A model is one file of
plain numbers.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from pickle import UnpicklingError

import numpy as np
import torch

from gns.data.distance import Neighbours
from gns.direct.effects import NAMES
from gns.direct.network import Answer, DirectConfig, DirectModel, features
from gns.direct.sections import COLUMN, SectionColumns, places
from pipeline.cli import InputError
from pipeline.files import atomic_path

MODEL_FILE = "direct.pt"
#: What torch raises on a file that is cut short, damaged or of another form.
DAMAGE = (KeyError, TypeError, ValueError, RuntimeError, EOFError, OSError)
#: Share of the runs that an interval covers.
COVERED = 0.9
DESCRIPTORS = (
    "area",
    "width",
    "left face",
    "right face",
    "strength",
    "strength of the base",
    "weakest tenth",
    "friction",
    "density",
    "water",
    "fall of the water",
    "slope of the ground",
    "room",
)
"""What two sections are compared by; see `described`."""


@dataclass(frozen=True)
class Forecast:
    """What a model predicts of one section.

    Attributes:
        toes: left and right, x (2,) [m].
        toe_interval: half-width of an interval that covers COVERED of the runs, (2,) [m].
        thickness: of the deposit in each column, (C,) [m].
        thickness_interval: half-width of its interval, (C,) [m].
        times: when the left toe, the right toe and all soil have done `SHARES` of their way,
            (3, S) [s]; of a toe that stays they mean nothing.
        times_within: factor by which the interval of a time goes above and below it, (3, S).
    """

    toes: np.ndarray
    toe_interval: np.ndarray
    thickness: np.ndarray
    thickness_interval: np.ndarray
    times: np.ndarray
    times_within: np.ndarray


@dataclass(frozen=True)
class DirectPredictor:
    """A model with its calibration.

    Attributes:
        model: its networks; their weights stay as they are.
        toe_factor: half-width of a toe's interval over its scale; thickness_factor, time_factor:
            likewise.
        known: descriptors of the sections learned from, (N, F); their mirror images are as well
            known.
        unit: of a distance, `unit_of` them.
    """

    model: DirectModel
    toe_factor: float
    thickness_factor: float
    time_factor: float
    known: np.ndarray
    unit: float

    @property
    def effects(self) -> tuple[str, ...]:
        """Effects of the solver that it has learned."""
        return self.model.config.effects

    def check_learned(self, section: SectionColumns, name: str) -> None:
        """Refuse a section with an effect that it has not learned.

        Raises:
            InputError: `name` of the scene, and that of the effect.
        """
        for one, amplitude in zip(NAMES, section.effects, strict=True):
            if amplitude and one not in self.effects:
                raise InputError(
                    f"{name}: effects: {one} is on; this direct model has not learned it"
                )

    def predict(self, section: SectionColumns, before: np.ndarray) -> Forecast:
        """The forecast of a section.

        Args:
            section: its columns.
            before: toes before the slide, x (2,) [heights from its middle].
        """
        with torch.no_grad():
            values = torch.as_tensor(section.values, dtype=torch.float32)
            answer = self._answer(section, before, values)
        height, found = section.height, {k: v[0].double().numpy() for k, v in vars(answer).items()}
        return Forecast(
            section.middle + height * found["toes"],
            height * self.toe_factor * found["toe_scale"],
            height * found["thickness"],
            height * self.thickness_factor * found["thickness_scale"],
            section.unit_s * np.exp(found["log_times"]),
            np.exp(self.time_factor * found["time_scale"]),
        )

    def derivative(
        self, section: SectionColumns, before: np.ndarray, tangents: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Exact derivative along changes of the zones' values, in double precision.

        Args:
            section: its columns.
            before: toes before the slide [heights].
            tangents: (p, Z, 3) in the units of `SectionColumns.values`.

        Returns:
            of the toes (p, 2), of the thickness (p, C) [m] and of the times (p, 3, S) [s].
        """
        model = DirectModel(self.model.config).double().eval()
        model.load_state_dict(self.model.state_dict())
        values = torch.as_tensor(section.values, dtype=torch.float64)

        def outcome(at: torch.Tensor) -> tuple[torch.Tensor, ...]:
            answer = self._answer(section, before, at, model=model)
            return answer.toes[0], answer.thickness[0], answer.log_times[0].exp()

        found = [
            torch.func.jvp(outcome, (values,), (torch.as_tensor(one, dtype=torch.float64),))[1]
            for one in tangents
        ]
        units = (section.height, section.height, section.unit_s)
        slopes = zip(units, zip(*found, strict=True), strict=True)
        return tuple(
            unit * np.stack([one.detach().numpy() for one in slope]) for unit, slope in slopes
        )

    def distance(self, section: SectionColumns) -> float:
        """To the nearest section learned from; 1: as the outermost of these."""
        return self._neighbours.distance(described(section)) / self.unit

    @cached_property
    def _neighbours(self) -> Neighbours:
        return Neighbours(both_ways(self.known))

    def _answer(self, section, before, values, model=None) -> Answer:
        model = self.model if model is None else model
        return model(features([section], np.asarray(before)[None], values[None]))

    def save(self, path: Path) -> None:
        """Write the model; see `load`."""
        path.parent.mkdir(parents=True, exist_ok=True)
        with atomic_path(path) as temporary:
            torch.save(
                {
                    "config": asdict(self.model.config),
                    "weights": self.model.state_dict(),
                    "factors": [
                        self.toe_factor,
                        self.thickness_factor,
                        self.time_factor,
                        self.unit,
                    ],
                    "known": torch.as_tensor(self.known, dtype=torch.float32),
                },
                temporary,
            )

    @classmethod
    def load(cls, path: Path) -> DirectPredictor:
        """Read a model as plain numbers: nothing in the file is executed.

        Raises:
            InputError: no such file, or not one of this form.
        """
        if not path.is_file():
            raise InputError(f"{path}: no such file; flowslide gns direct-train leaves one")
        try:
            kept = torch.load(path, map_location="cpu", weights_only=True)
            config = {**kept["config"], "widths": tuple(kept["config"]["widths"])}
            config["effects"] = tuple(config.get("effects", ()))
            config.pop("corrected", None)  # of models saved before 0.2, which knew another kind
            model = DirectModel(DirectConfig(**config))
            model.load_state_dict(kept["weights"])
            toe, thickness, times, unit = kept["factors"]
            known = kept["known"].numpy().astype(float)
        except (*DAMAGE, UnpicklingError) as error:
            reason = str(error).splitlines()[0] if str(error) else type(error).__name__
            raise InputError(f"{path}: is not a direct model: {reason}") from None
        return cls(model.eval().requires_grad_(False), toe, thickness, times, known, unit)


def described(section: SectionColumns) -> np.ndarray:
    """A section in a few numbers of about unit spread over the training, (F,).

    The mirror image has the same numbers, but for the faces and the fall of the water
    (`both_ways`).
    """
    soil = section.thickness > 0.0
    depth = section.thickness[soil]
    cohesion = np.einsum("ckz,z->ck", section.strength_share[soil], section.values[:, 0])
    friction = np.einsum("ckz,z->ck", section.zone_share[soil], section.values[:, 1])
    layers = friction.shape[1]
    cover = depth[:, None] * (1.0 - (np.arange(layers) + 0.5) / layers)
    weight = depth[:, None] * np.ones(layers)
    strength = np.maximum(cohesion + 0.7 * friction * cover, 2e-3)
    weakest = np.quantile(strength, 0.1)
    x = places()
    peak = x[soil][depth > 0.95 * depth.max()]
    left, right = section.feet
    water = section.water[soil]
    wet = np.clip(water / np.maximum(depth, 0.05), -0.5, 1.5)
    slope = np.ptp(section.ground[soil]) / max(np.ptp(x[soil]), COLUMN)
    open_room = np.sum(section.wall == 0.0) * COLUMN
    return np.array(
        [
            depth.sum() * COLUMN,
            0.5 * (right - left),
            peak.min() - left,
            right - peak.max(),
            np.log(np.average(strength, weights=weight)) * 1.5,
            np.log(strength[:, 0].mean()) * 1.2,
            np.log(weakest),
            np.average(friction, weights=weight) * 4.0,
            (section.density - 1.9) * 4.0,
            wet.mean() * 1.5,
            (water[0] - water[-1]) * 1.5,
            slope * 20.0,
            (open_room - 20.0) / 8.0,
        ]
    )


def both_ways(described: np.ndarray) -> np.ndarray:
    """Descriptors (N, F) and, each after its own, those of the mirror images, (2 N, F)."""
    turned = described.copy()
    left, right, fall = map(DESCRIPTORS.index, ("left face", "right face", "fall of the water"))
    turned[:, [left, right]] = described[:, [right, left]]
    turned[:, fall] = -described[:, fall]
    return np.stack([described, turned], axis=1).reshape(-1, described.shape[1])


def unit_of(known: np.ndarray) -> float:
    """The unit of a distance to sections with these descriptors (N, F)."""
    return Neighbours(both_ways(known)).unit(alike=2)
