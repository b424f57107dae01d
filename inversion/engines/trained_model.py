"""A trained simulator in its folder: found, checked, read.

In: the name of a model or a folder. Out: a `TrainedModel`. The weights are read as plain numbers,
so that nothing in a model from elsewhere is executed.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from gns.evaluation.card import CARD_FILE, read_card
from gns.network.simulator import Simulator
from gns.training.checkpoints import MODEL_FILE
from pipeline.cli import InputError
from pipeline.files import file_hash


@dataclass(frozen=True)
class TrainedModel:
    """A trained simulator.

    Attributes:
        simulator: its weights are never changed here.
        name: of its folder.
        sha256: of its file of weights.
    """

    simulator: Simulator
    name: str
    sha256: str

    @property
    def hash(self) -> str:
        """Everything in the model that determines a rollout: weights, dtype, device."""
        parameter = next(self.simulator.parameters())
        return f"{self.sha256} {parameter.dtype} {parameter.device.type}"


def load_model(folder: str | Path, device: str = "cpu") -> TrainedModel:
    """Read a model's folder; nothing in its files is executed.

    Raises:
        InputError: no such folder, no weights, a damaged file, weights of another form than the
            configuration next to them says, or a card that belongs to other weights.
    """
    folder = Path(folder)
    path = folder / MODEL_FILE
    if not path.is_file():
        raise InputError(
            f"{path}: no such file; a model is a folder with {MODEL_FILE}, as flowslide gns train "
            "leaves it"
        )
    simulator = Simulator.load(path, device).requires_grad_(False)
    sha256 = file_hash(path)
    if (folder / CARD_FILE).is_file():
        if read_card(folder / CARD_FILE).weights_sha256 != sha256:
            raise InputError(
                f"{folder / CARD_FILE}: weights_sha256: is not that of {MODEL_FILE} next to it; "
                "card and weights must belong together"
            )
    return TrainedModel(simulator, folder.resolve().name, sha256)
