"""Which measurement asks for which strength, in words.

In: what `inversion.back_analysis.implied_strengths` found. Out: a line for each measurement, and a
sentence of how it was read.
"""

from __future__ import annotations

from inversion.back_analysis.implied_strengths import (
    ImpliedStrength,
    ImpliedStrengths,
    implied_strengths,
)
from inversion.back_analysis.result import ParameterAnswer, Result
from report.numbers import at_least, fixed, span

UNIT = "kPa"
FAR = 2.0
"""Root mean square, in std, from which on it is said that a series is not met at its best."""


def asked_words(one: ImpliedStrength) -> str:
    """What one measurement asks for: a strength with its range, or why there is none."""
    if one.status == "nothing" or one.value is None:
        if one.is_limit:
            return "says nothing: kept at every strength that was tried"
        return "says nothing: halving the strength moves it by less than one std"
    value = fixed(one.value)
    if one.status == "met":
        return f"{_met(one)}{_also(one)}{_at_best(one)}"
    away = _away(one)
    if one.status == "unmet":
        return f"no strength that was tried: {away} at best, at {value} {UNIT}"
    return f"{'less' if one.status == 'less' else 'more'} than {value} {UNIT}: there still {away}"


def _met(one: ImpliedStrength) -> str:
    value = fixed(one.value)
    if one.is_limit:
        return f"at least {value} {UNIT}"
    if one.low is None and one.high is None:
        return f"{value} {UNIT}, or any other that was tried"
    if one.low is None:
        return f"{value} {UNIT} (up to {fixed(one.high)})"
    if one.high is None:
        return f"{value} {UNIT} (from {fixed(one.low)} on)"
    return f"{value} {UNIT} ({span(one.low, one.high)})"


def _also(one: ImpliedStrength) -> str:
    return "".join(f", or {fixed(value)} {UNIT}" for value in one.also)


def _at_best(one: ImpliedStrength) -> str:
    """How well a series is met by the strength that suits it best, where that is not well."""
    return f", {_away(one)} even there" if one.off is not None and abs(one.off) > FAR else ""


def _away(one: ImpliedStrength) -> str:
    off = one.off or 0.0
    if one.numbers > 1:
        return f"{fixed(off)} std off (root mean square)"
    return f"{fixed(abs(off))} std too {'large' if off > 0 else 'small'}"


def label_words(one: ImpliedStrength) -> str:
    """The measurement and what the search did with it."""
    return f"{one.name} ({one.role})"


def answer_band(p: ParameterAnswer) -> tuple[float, float | None, str]:
    """Ends of the answer's 95 % interval, the upper one None for a bound, and both in words."""
    if p.lower_bound_95 is not None:
        return p.lower_bound_95, None, at_least(p.lower_bound_95, p.std_total, p.unit)
    low, high = p.interval_95
    return low, high, f"{fixed(p.value)} {UNIT}, 95 % {span(low, high)}"


def how_words(found: ImpliedStrengths) -> str:
    """How the strengths were read."""
    low, high = fixed(found.tried[0]), fixed(found.tried[1])
    runs = "" if low == high else f"the runs of the search, between {low} and {high} {UNIT}, and "
    others = f", with {' and '.join(found.others)} as answered" if found.others else ""
    return (
        f"Read off {runs}the slope at the answer{others}; bars: where the measurement is one "
        "standard deviation off."
    )


def how_sentences(result: Result) -> list[str]:
    """How the strengths of a result were read, once for each that was sought."""
    found = [one for one in implied_strengths(result) if one.each]
    if len(found) < 2:
        return [how_words(one) for one in found]
    return [f"{one.parameter.label}: {how_words(one)}" for one in found]
