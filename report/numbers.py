"""Numbers as text, for pages, pictures and terminals: few digits, signs, units."""

from __future__ import annotations

import math

from pipeline.units import with_signs

MINUS, TIMES = "\N{MINUS SIGN}", "\N{MULTIPLICATION SIGN}"
LN_RATIO = "ln ratio"
"""Unit of the natural logarithm of a ratio, which is written as the factor."""
MOST_LOG = math.log(1e4)
"""Logarithm of the largest factor that is written out."""


def number(value: float, digits: int = 3) -> str:
    """A number in few digits, without powers of ten."""
    if value == 0 or not math.isfinite(value):
        return "0" if value == 0 else str(value)
    places = max(0, digits - 1 - math.floor(math.log10(abs(value))))
    text = f"{value:.{min(places, 6)}f}"
    if "." in text:
        text = text.rstrip("0").rstrip(".")
    return text.replace("-", MINUS)


def fixed(value: float | None, places: int = 1) -> str | None:
    """A number with this many decimal places; None stays None."""
    return None if value is None else _without_sign_of_zero(f"{value:.{places}f}")


def signed(value: float | None, places: int = 1) -> str | None:
    """A change with its sign; zero has none. None stays None."""
    return None if value is None else _without_sign_of_zero(f"{value:+.{places}f}")


def percent(share: float) -> str:
    """A share as a percentage."""
    return f"{100 * share:.0f} %"


def signed_percent(change: float) -> str:
    """A change [%] with its sign."""
    return f"{change:+.0f} %".replace("-", MINUS)


def chance(p: float) -> str:
    """A probability that noise alone gives this: p = 0.03, or p < 0.001."""
    return "p < 0.001" if p < 0.001 else f"p = {p:.2g}" if p < 0.1 else f"p = {p:.2f}"


def unit_of(name: str) -> str:
    """A unit as it is written."""
    return "°" if name == "deg" else with_signs(name)


def with_unit(value: float | str, unit: str, digits: int = 3) -> str:
    """A number, or one that is text already, and its unit; of a logarithm the factor."""
    if unit == LN_RATIO and not isinstance(value, str):
        return f"{TIMES} {_factor(value, digits)}"
    text = value if isinstance(value, str) else number(value, digits)
    written = unit_of(unit)
    return f"{text}{'' if written in ('', '°') else ' '}{written}"


def plus_minus(value: float, std: float, unit: str = "") -> str:
    """A value with its standard deviation, to two digits of the latter.

    Of a logarithm the factor, and between which factors a standard deviation either way is. What
    was not fitted has none.
    """
    if std == 0.0:
        return with_unit(value, unit)
    if unit == LN_RATIO:
        return f"{with_unit(value, unit)} ({from_to(value - std, value + std, unit)})"
    places = places_by(std)
    return with_unit(f"{fixed(value, places)} ± {std:.{places}f}", unit)


def from_to(low: float, high: float, unit: str = "") -> str:
    """An interval; its unit stands next to the value, and of a logarithm it is one of factors."""
    text = _factor if unit == LN_RATIO else number
    return " to ".join(text(end) for end in (low, high))


def at_least(value: float, std: float, unit: str = "") -> str:
    """A lower bound of 95 %, to two digits of the standard deviation behind it."""
    places = places_by(std)
    return f"≥ {with_unit(fixed(value, places), unit)} (95 %)"


def limited(value: float | None, censored: bool, std: float | None = None) -> str | None:
    """A measured value, or the limit that it kept below, to the digits of its deviation."""
    places = measured_places(std)
    return f"< {fixed(value, places)}" if censored else fixed(value, places)


def span(low: float | None, high: float | None, places: int = 1) -> str | None:
    """A range; None where it has no ends."""
    return None if low is None or high is None else f"{fixed(low, places)} to {fixed(high, places)}"


def places_of(unit: str) -> int:
    """Decimal places of an unknown's value: one, and three of a ratio, which has no unit."""
    return 1 if unit else 3


def places_by(std: float) -> int:
    """Decimal places that show a standard deviation in two digits, three at most."""
    return min(max(0, 1 - math.floor(math.log10(std))), 3) if std > 0 else 2


def measured_places(std: float | None) -> int:
    """Decimal places of a measurement and of what predicts it: one, more where it is so exact."""
    return max(1, places_by(10.0 * std)) if std else 1


def plural(count: int, noun: str) -> str:
    """A count and its noun: 1 step, 2 steps."""
    return f"{count} {noun}{'' if count == 1 else 's'}"


def root_mean_square(chi2: float, n: float) -> float:
    """How far a model is from the data, in standard deviations; noise alone gives 1."""
    return math.sqrt(max(chi2, 0.0) / n) if n > 0 else math.nan


def _factor(log: float, digits: int = 3) -> str:
    """The factor of a logarithm; where it could be anything, beyond which it lies."""
    if abs(log) > MOST_LOG:
        return f"over {number(math.exp(MOST_LOG), 1)}" if log > 0 else "0"
    return number(math.exp(log), digits)


def _without_sign_of_zero(text: str) -> str:
    return text.lstrip("+-") if not float(text) else text.replace("-", MINUS)
