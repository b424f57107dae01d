"""The state of a training on the disk, so that it can be stopped at any time and goes on.

A folder of a model holds `model.pt` (the best so far by its held-out rollouts: what everybody else
reads), `metrics.jsonl` (a line for each stretch of steps and each validation) and `state/last.pt`
(all that is needed to go on; no result, it may be removed once a training has ended). Each file
appears when it is whole.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import torch

from gns.network.simulator import FORMAT_VERSION, Simulator, read_document
from pipeline.cli import InputError
from pipeline.files import atomic_path, make_folder, only_one, read_text, write_text

MODEL_FILE = "model.pt"
METRICS_FILE = "metrics.jsonl"
STATE_FILE = Path("state") / "last.pt"
DRAWN = ("score", "position_error", "runout_error")
"""Numbers of a validation that a picture shows."""


class ModelFolder:
    """The files of one training.

    Args:
        folder: made if missing.

    Raises:
        InputError: the folder cannot be written.
    """

    def __init__(self, folder: str | Path) -> None:
        self.folder = make_folder(folder)
        self.model = self.folder / MODEL_FILE
        self.state = self.folder / STATE_FILE
        self.metrics = self.folder / METRICS_FILE

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Refuse a second process on the same training (a job queued again while the first runs).

        Raises:
            WorkFailed: another process works on it.
        """
        with only_one(self.state.parent, f"{self.folder}: another process is training here"):
            yield

    def set_aside(
        self, made_from: Mapping[str, Any], beginnings: Sequence[Mapping[str, Any]] = ()
    ) -> Path | None:
        """Make room where the folder holds another training; return where that is now.

        Nothing is removed: a model may have cost weeks. It can go on there, and its evaluation goes
        with it. `beginnings` as of `load_state`.
        """
        if not self.state.exists():
            return None
        if self._other(read_document(self.state), made_from, beginnings) is None:
            return None
        number = 1
        before = self.folder.with_name(f"{self.folder.name}.before")
        # A place without a state is one that a kill left half filled.
        while any((place := Path(f"{before}-{number}")).rglob(STATE_FILE.name)):
            number += 1
        make_folder(place / STATE_FILE.parent)
        files = [path for path in self.folder.iterdir() if path.is_file()]
        for path in (*sorted(files), self.state):  # the state last: killed before, it is done again
            path.rename(place / path.relative_to(self.folder))
        return place

    def save_model(self, simulator: Simulator, **more: Any) -> None:
        """Write the model that others read; `more` are plain values that are kept with it."""
        simulator.save(self.model, **more)

    def save_state(self, made_from: Mapping[str, Any], **state: Any) -> None:
        """Write all that is needed to go on; `made_from` says of which training."""
        make_folder(self.state.parent)
        document = {
            "format_version": FORMAT_VERSION,
            "made_from": json.dumps(made_from, sort_keys=True),
            **state,
        }
        with atomic_path(self.state) as temporary:
            torch.save(document, temporary)

    def load_state(
        self,
        made_from: Mapping[str, Any],
        device: torch.device | str,
        beginnings: Sequence[Mapping[str, Any]] = (),
    ) -> dict[str, Any] | None:
        """The state of the same training, or None where there is none yet.

        Args:
            made_from: says of which training.
            device: where its tensors go.
            beginnings: other trainings that this one goes on from, if one of them is there.

        Raises:
            InputError: the folder holds another training, or the state is damaged.
        """
        if not self.state.exists():
            if self.model.exists():
                raise InputError(
                    f"{self.folder}: holds a model, but no state from which to go on; give another "
                    "folder with --out, or learn on from it with --from"
                )
            return None
        document = read_document(self.state, device)
        other = self._other(document, made_from, beginnings)
        if other:
            raise InputError(
                f"{self.folder}: holds a training with {other}; give another folder with --out, or "
                "set this one aside with --start-over"
            )
        return document

    @staticmethod
    def _other(
        document: Mapping[str, Any],
        made_from: Mapping[str, Any],
        beginnings: Sequence[Mapping[str, Any]],
    ) -> str | None:
        """In what a state is of another training, in words; None: of the same, or a beginning."""
        old = json.loads(document["made_from"])
        faults = []
        for one in (made_from, *beginnings):
            new = json.loads(json.dumps(one))
            differ = [name for name in sorted({*old, *new}) if old.get(name) != new.get(name)]
            if not differ:
                return None
            name = differ[0]
            faults.append(f"{name} = {old.get(name)}, not {new.get(name)}")
        return faults[0]

    # -- metrics -------------------------------------------------------------------------------

    def write_metrics(self, line: Mapping[str, Any]) -> None:
        """Add one line."""
        with self.metrics.open("a", encoding="utf-8") as file:
            file.write(json.dumps(line, allow_nan=False) + "\n")

    def read_metrics(self) -> list[dict[str, Any]]:
        """All lines; a last one that a kill has cut short is left out.

        Raises:
            InputError: no text, or a line that is none of a training.
        """
        if not self.metrics.exists():
            return []
        lines = []
        for number, text in enumerate(read_text(self.metrics).splitlines(), start=1):
            try:
                line = json.loads(text)
            except json.JSONDecodeError:
                break
            if not _is_of_a_training(line):
                raise InputError(
                    f"{self.metrics}: line {number}: {text[:40]!r} is not a line of a training: it "
                    "has a step, and a loss or a validation"
                )
            lines.append(line)
        return lines

    def cut_metrics(self, step: int) -> None:
        """Forget what was written after a step: the steps from there on are taken again."""
        kept = [line for line in self.read_metrics() if line["step"] <= step]
        write_text(self.metrics, "".join(json.dumps(line, allow_nan=False) + "\n" for line in kept))


def _is_of_a_training(line: Any) -> bool:
    """Numbers stand where they are drawn: of a stretch of steps, or of a validation."""
    if not isinstance(line, dict) or not isinstance(line.get("step"), int):
        return False
    found = line.get("validation", dict.fromkeys(DRAWN, 0.0))
    numbers = [line.get("loss", 0.0)]
    numbers += [found.get(name) for name in DRAWN] if isinstance(found, dict) else [None]
    return all(isinstance(number, int | float) and math.isfinite(number) for number in numbers)
