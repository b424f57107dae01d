"""What a learned model says of a slide before the solver has simulated it.

The direct model answers in some 20 ms, the solver in some hundred: the page shows its band until
the deposit is there. Where it does not apply (effects, a bent base, a section beyond its training,
no torch on this machine) there is no answer. It runs in a process of its own (`live_process`),
since its libraries are large.
"""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor
from threading import Lock
from typing import TYPE_CHECKING

import numpy as np

from flowslide.studio.frames import message
from flowslide.studio.live import Question
from geometry.case import Case
from geometry.scenes.fill import fill
from pipeline.cli import InputError
from pipeline.files import content_hash

if TYPE_CHECKING:
    from gns.direct.predictor import DirectPredictor
    from gns.direct.sections import SectionColumns

#: A base that is nowhere farther from a straight line is one [m].
STRAIGHT_M = 0.01
#: What changes the strengths alone, so that the section before the slide stays.
STRENGTHS = ("cohesion_kpa", "friction_deg")


class Forecaster:
    """Forecasts of questions; an older one of the same asker gets none.

    Args:
        threads: CPU threads, for `live_process`, which starts the process with so many.
    """

    def __init__(self, threads: int | None = None) -> None:
        self.threads = threads
        self._owner = ThreadPoolExecutor(1, thread_name_prefix="forecast")
        self._lock = Lock()
        self._newest: dict[object, int] = {}
        self._predictor: DirectPredictor | None = None
        self._begun: tuple[str, SectionColumns, np.ndarray] | None = None

    def warm(self, case: Case) -> Future[bytes | None]:
        """Have the model loaded before the first question."""
        return self.ask(Question(0, case, film=False))

    def ask(self, asked: Question, asker: object = None) -> Future[bytes | None]:
        """The forecast as a message for the page; None: there is none, or a newer question."""
        with self._lock:
            self._newest[asker] = asked.number
        return self._owner.submit(self._answer, asked, asker)

    def stop(self, asker: object = None) -> None:
        """Forget an asker."""
        with self._lock:
            self._newest.pop(asker, None)

    def _answer(self, asked: Question, asker: object) -> bytes | None:
        if self._newest.get(asker) != asked.number:
            return None
        try:
            return self._forecast(asked)
        except (ImportError, InputError):  # it is not here, or does not know such a section
            return None

    def _forecast(self, asked: Question) -> bytes | None:
        from gns.data.distance import FARTHEST
        from inversion.engines.direct_engine import shipped

        if self._predictor is None:
            self._predictor = shipped("direct").predictor
        section, before = self._section(asked.case)
        self._predictor.check_learned(section, asked.case.scene.name)
        if self._predictor.distance(section) > FARTHEST:
            return None
        found = self._predictor.predict(section, before)
        ground = section.base + section.height * section.ground
        arrays = {
            "x": section.x,
            "low": ground + np.maximum(found.thickness - found.thickness_interval, 0.0),
            "middle": ground + np.maximum(found.thickness, 0.0),
            "high": ground + np.maximum(found.thickness + found.thickness_interval, 0.0),
        }
        header = {
            "type": "forecast",
            "id": asked.number,
            "toes": found.toes.tolist(),
            "toe_interval": found.toe_interval.tolist(),
        }
        return message(header, {name: one.astype("<f4") for name, one in arrays.items()})

    def _section(self, case: Case) -> tuple[SectionColumns, np.ndarray]:
        """The section as the model sees it, and its toes before the slide.

        Raises:
            InputError: the model does not know such a section.
        """
        from gns.direct.sections import check_settings, section_of, toes_of, with_strengths

        scene, settings = case.scene, case.simulation
        document = scene.model_dump(mode="json")
        for soil in document["materials"].values():
            for key in STRENGTHS:
                del soil[key]
        key = content_hash([document, settings.model_dump(mode="json")])
        if self._begun is None or self._begun[0] != key:
            check_settings(scene, settings)
            if not _is_straight(np.array(scene.ground.points)):
                raise InputError(f"{scene.name}: the direct model knows a straight base alone")
            section = section_of(scene, settings.gravity_m_per_s2)
            points = fill(scene)
            before = toes_of(section, points.position, points.volume, scene.spacing)
            self._begun = key, section, before
        _, section, before = self._begun
        return with_strengths(section, scene), before


def _is_straight(points: np.ndarray) -> bool:
    """Whether all points (N, 2) lie on the line through the first and the last."""
    x, y = points.T
    return bool(np.abs(y - np.interp(x, x[[0, -1]], y[[0, -1]])).max() < STRAIGHT_M)
