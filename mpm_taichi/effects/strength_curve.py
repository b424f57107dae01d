"""A strength law that is not known: a multiplier drawn by hat functions in one variable.

For effects that no entry of the library describes. No candidate: the diagnosis fits its
coefficients where nothing else explains a misfit (`diagnosis`), and draws the curve.
"""

from __future__ import annotations

from collections.abc import Sequence

from mpm_taichi.effects.framework.base import Amplitude, Effect, Parameter, needs_liquefied_soil, ti
from pipeline.cli import InputError

VARIABLES = ("strain_rate", "strain", "time", "overburden", "position")
"""The multiplier's possible variables: log10 of the rate of shear [1/s], plastic shear strain, time
[s], vertical effective stress before failure [kPa], x at the start [m]. The place in this tuple is
the number `variable`."""

MOST_KNOTS = 7


def strength(effect, soil, here):  # noqa: ANN001, ANN201
    """S = S_r exp(a sum of c_j phi_j(u)), constant beyond the first and the last knot."""
    if here.liquefied > 0.5:
        u = ti.log(ti.max(here.strain_rate, 1.0e-12)) * 0.43429448
        if effect.variable > 0.5:
            u = here.strain
        if effect.variable > 1.5:
            u = here.time
        if effect.variable > 2.5:
            u = 1.0e-3 * here.overburden
        if effect.variable > 3.5:
            u = here.x0
        last = effect.knots - 1.0
        place = (u - effect.first_knot) / (effect.last_knot - effect.first_knot) * last
        place = ti.min(ti.max(place, 0.0), last)
        total = effect.c0 * ti.max(1.0 - place, 0.0)
        total += effect.c1 * ti.max(1.0 - ti.abs(place - 1.0), 0.0)
        total += effect.c2 * ti.max(1.0 - ti.abs(place - 2.0), 0.0)
        total += effect.c3 * ti.max(1.0 - ti.abs(place - 3.0), 0.0)
        total += effect.c4 * ti.max(1.0 - ti.abs(place - 4.0), 0.0)
        total += effect.c5 * ti.max(1.0 - ti.abs(place - 5.0), 0.0)
        total += effect.c6 * ti.max(1.0 - ti.abs(place - 6.0), 0.0)
        soil.cohesion *= ti.exp(effect.amplitude * total)
    return soil


def entry(variable: str, knots: Sequence[float], coefficients: Sequence[float]) -> dict[str, float]:
    """The entry `strength_curve` of a scene's `effects` for a curve.

    Args:
        variable: one of `VARIABLES`.
        knots: where the hat functions have their tops, evenly spaced and ascending, (k,) in the
            variable's unit; 2 to 7 of them.
        coefficients: logarithm of the multiplier at each knot, (k,).

    Raises:
        InputError: an unknown variable, knots that are not even, another number of coefficients.
    """
    if variable not in VARIABLES:
        known = ", ".join(VARIABLES)
        raise InputError(f"strength_curve: variable {variable!r} is unknown; known are: {known}")
    count = len(knots)
    if not 2 <= count <= MOST_KNOTS or len(coefficients) != count:
        raise InputError(
            f"strength_curve: {count} knots and {len(coefficients)} coefficients: allowed are 2 to "
            f"{MOST_KNOTS}, as many of the one as of the other"
        )
    gap = (knots[-1] - knots[0]) / (count - 1)
    even = all(abs(knots[0] + j * gap - knot) <= 1e-6 * abs(gap) for j, knot in enumerate(knots))
    if gap <= 0.0 or not even:
        raise InputError(f"strength_curve: knots {list(knots)} must ascend in equal steps")
    return {
        "amplitude": 1.0,
        "variable": float(VARIABLES.index(variable)),
        "knots": float(count),
        "first_knot": float(knots[0]),
        "last_knot": float(knots[-1]),
        **{f"c{j}": float(value) for j, value in enumerate(coefficients)},
    }


EFFECT = Effect(
    name="strength_curve",
    words="the strength of the liquefied soil changes by a law that is not in the library",
    equation="S = S_r exp(a sum_j c_j phi_j(u)), phi_j hat functions, u one variable",
    source="piecewise linear interpolation of the logarithm of a multiplier",
    looks_like="whatever the curve says",
    amplitude=Amplitude(
        unit="",
        low=0.0,
        high=1.0,
        ladder=(0.25, 0.5, 1.0),
        meaning="factor of all coefficients",
    ),
    parameters=(
        Parameter(
            "variable", "", 0, 0, len(VARIABLES) - 1, "place of u in " + ", ".join(VARIABLES)
        ),
        Parameter("knots", "", 5, 2, MOST_KNOTS, "number of hat functions"),
        Parameter("first_knot", "of u", -3.0, -1e6, 1e6, "u at the top of the first"),
        Parameter("last_knot", "of u", 1.0, -1e6, 1e6, "u at the top of the last"),
        *(
            Parameter(f"c{j}", "", 0.0, -5.0, 5.0, f"logarithm of the multiplier at knot {j}")
            for j in range(MOST_KNOTS)
        ),
    ),
    internal=True,
    strength=strength,
    applies=needs_liquefied_soil,
)
