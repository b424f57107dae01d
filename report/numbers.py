"""Numbers as text, for pages and pictures: few digits, true minus signs, no powers of ten."""

from __future__ import annotations

import math

MINUS, SPACE = "\N{MINUS SIGN}", "\N{NO-BREAK SPACE}"


def number(value: float, digits: int = 3) -> str:
    """A number in few digits, with a true minus sign and without powers of ten."""
    if value == 0 or not math.isfinite(value):
        return "0" if value == 0 else str(value)
    places = max(0, digits - 1 - math.floor(math.log10(abs(value))))
    text = f"{value:.{min(places, 6)}f}"
    if "." in text:
        text = text.rstrip("0").rstrip(".")
    return text.replace("-", MINUS)


def chance(p: float) -> str:
    """A probability of noise in words: p = 0.03, or p < 0.001."""
    text = "p < 0.001" if p < 0.001 else f"p = {p:.2g}" if p < 0.1 else f"p = {p:.2f}"
    return text.replace(" ", SPACE)


def with_unit(value: float, unit: str, digits: int = 3) -> str:
    """A number and its unit."""
    text = number(value, digits)
    return _joined(text, unit)


def plus_minus(value: float, std: float, unit: str) -> str:
    """A value with its standard deviation, to the digits the latter has."""
    places = max(0, 1 - math.floor(math.log10(std))) if std > 0 else 2
    places = min(places, 3)
    text = f"{value:.{places}f} ± {std:.{places}f}".replace("-", MINUS)
    return _joined(text, unit)


def root_mean_square(chi2: float, n: float) -> float:
    """How far off a model is, in standard deviations; noise alone gives 1."""
    return math.sqrt(max(chi2, 0.0) / n) if n > 0 else math.nan


def signed_percent(change: float) -> str:
    """A change with its sign."""
    return f"{change:+.0f}{SPACE}%".replace("-", MINUS)


def _joined(text: str, unit: str) -> str:
    """A number and its unit, kept on one line."""
    text = text if not unit else f"{text}°" if unit == "deg" else f"{text} {unit}"
    return text.replace(" ", SPACE)
