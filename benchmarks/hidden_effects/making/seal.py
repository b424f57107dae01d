"""Sealing: the truth is written down, and only its hash is published before a diagnosis.

A salt keeps the truth from being guessed from its hash. It follows from the benchmark's seed, so
that the same benchmark has the same hashes wherever it is made; who judges does not read the seed.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from typing import Any

SALT = "salt"


def salt_of(seed: int, case: str) -> str:
    """Salt of a case, 32 hexadecimal digits."""
    return hashlib.sha256(f"flowslide {seed} {case}".encode()).hexdigest()[:32]


def seal(truth: Mapping[str, Any]) -> str:
    """SHA-256 (hex) of a truth with its salt, as canonical JSON.

    Raises:
        ValueError: the truth has no salt.
    """
    if not truth.get(SALT):
        raise ValueError(f"a truth without {SALT} can be guessed from its hash")
    text = json.dumps(truth, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()


def is_sealed(truth: Mapping[str, Any], sealed: str) -> bool:
    """Whether a truth is the one whose hash was published."""
    return bool(truth.get(SALT)) and seal(truth) == sealed
