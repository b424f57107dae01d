"""Units as a person reads them: keys and headings of files have m3, everything else m³."""

from __future__ import annotations

import re

_POWER = re.compile(r"(?<=\b[ms])[23]\b|(?<=\b[ck]m)[23]\b|(?<=\bft)[23]\b")
_SIGNS = {"2": "²", "3": "³"}


def with_signs(unit: str) -> str:
    """A unit, or words with units, with signs for powers: "kg/m3" -> "kg/m³"."""
    return _POWER.sub(lambda found: _SIGNS[found[0]], unit)
