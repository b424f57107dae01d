"""Where trained models are: a folder of one's own, or one that ships, by its name in `models/`."""

from __future__ import annotations

from pathlib import Path

MODELS = Path("models")


def model_folder(text: str | Path) -> Path:
    """The folder of a model given by its path, or by its name in `models`."""
    path, named = Path(text), MODELS / text
    return named if not path.is_dir() and named.is_dir() else path


def models_there() -> str:
    """Which models ship, for a message."""
    names = sorted(path.parent.name for path in MODELS.glob("*/model.pt"))
    return f"models/ has {', '.join(names)}" if names else "models/ has none"
