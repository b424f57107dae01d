"""Factors of safety of slices: ordinary method, balance of forces, Bishop, Spencer; and S_r for 1.

In: `Slices`, whose leading axes may be many slip surfaces. Out: factors of safety of that shape,
nan where a method has no solution. Numpy only; every function is vectorised over slip surfaces.

All but Bishop's, which is for circles, hold for any slip surface. Forces on a slice: K = (push
downhill, -weight), N and S on the base, Q the sum of the forces of its neighbours.

Sources: Fellenius (1936), Janbu (1954, simplified and without its correction), Bishop (1955),
Spencer (1967) with the general formulation of Wright's UTEXAS manuals and of the US Army's
EM 1110-2-1902 (2003), appendix C.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy as np

from inversion.classical.slices import Circle, Slices

Method = Literal["ordinary", "force", "bishop", "spencer"]

#: Inclinations of the forces between slices that Spencer's method looks at [rad].
INCLINATIONS = np.radians(np.linspace(-20.0, 45.0, 66))


def ordinary(slices: Slices, *, side_water: bool = True) -> np.ndarray:
    """Factor of safety by the ordinary method of slices (Fellenius, "Swedish").

    FS = sum (c l + N' tan phi) / sum (K . t), N' = -K . n - u l, never negative.

    Args:
        slices: on any slip surface.
        side_water: let the water in the neighbouring slices act on each slice, so that boundary
            pressures and buoyant weights agree; False is the textbook form, N' = W cos a - u l.
    """
    push = slices.push + slices.side_water if side_water else slices.push
    cosine, sine = np.cos(slices.angle), np.sin(slices.angle)
    normal = slices.weight * cosine - push * sine - slices.pore * slices.length
    driving = np.sum(slices.weight * sine + push * cosine, axis=-1)
    resistance = slices.cohesion * slices.length + np.maximum(normal, 0.0) * slices.friction
    return _ratio(np.sum(resistance, axis=-1), driving)


def bishop(slices: Slices, circle: Circle, *, rounds: int = 60) -> np.ndarray:
    """Factor of safety by Bishop's simplified method.

    FS = sum [c b + (W - u b) tan phi] / m_a / (sum W sin a + M / R), with
    m_a = cos a + sin a tan phi / FS and M the moment of the free water's push about the centre.

    Args:
        slices: on the circle; leading axes, if any, as those of the circle's numbers.
        circle: its numbers may be arrays with the leading axes of `slices`.
        rounds: of the fixed-point iteration.
    """
    radius, height = np.asarray(circle.radius), np.asarray(circle.y)
    # Positions on the arc, not on its chords: forces on the base pass through the centre.
    sine = np.clip(-slices.downhill * (slices.x - _last(circle.x)) / _last(radius), -1.0, 1.0)
    cosine = np.sqrt(1.0 - sine**2)
    moment = height * slices.push.sum(axis=-1) - slices.push_moment.sum(axis=-1)
    driving = np.sum(slices.weight * sine, axis=-1) + moment / radius
    strength = (
        slices.cohesion * slices.width
        + (slices.weight - slices.pore * slices.width) * slices.friction
    )
    factor = np.ones(driving.shape)
    for _ in range(rounds):
        with np.errstate(divide="ignore", invalid="ignore"):
            m = cosine + sine * slices.friction / factor[..., None]
            new = _ratio(np.sum(strength / np.maximum(m, 0.05), axis=-1), driving)
        done = np.allclose(new, factor, rtol=1e-10, atol=0.0, equal_nan=True)
        factor = new
        if done:
            break
    return factor


def force_balance(slices: Slices) -> np.ndarray:
    """Factor of safety from the balance of forces alone, those between slices being level.

    Janbu's simplified method without its correction. It leaves moments aside, and so has a solution
    on flat, long masses on which Spencer's has none.
    """
    return _factor_at(slices, np.zeros(slices.x.shape[:-1]))[0]


def spencer(slices: Slices) -> np.ndarray:
    """Factor of safety by Spencer's method: all forces and moments, parallel forces between slices.

    Returns:
        nan where no inclination of the forces between slices balances the moments.
    """
    return _balanced(slices, _factor_at)[0]


def spencer_inclination(slices: Slices) -> tuple[np.ndarray, np.ndarray]:
    """Factor of safety by Spencer's method, and the inclination of the forces between slices [rad].

    The inclination counts positive where the force on a slice's upper side points downwards.
    """
    return _balanced(slices, _factor_at)


def required_strength(
    slices: Slices,
    method: Method,
    circle: Circle | None = None,
    *,
    factor: float = 1.0,
    others: float = 1.0,
) -> np.ndarray:
    """The S_r [Pa] of the liquefied bases at which a factor of safety is reached.

    Args:
        slices: on a slip surface that passes through liquefied soil.
        method: of limit equilibrium.
        circle: the slip surface; for Bishop's method only.
        factor: the factor of safety.
        others: multiplies the strength of the soil that has not liquefied; 0 leaves it out.

    Returns:
        Of the shape of the leading axes; negative where the mass stands without S_r, nan where no
        base is liquefied or Spencer's method has no solution.
    """
    liquefied = np.sum(np.where(slices.liquefied, slices.length, 0.0), axis=-1)
    if method == "spencer":
        base = slices.with_strength(0.0, others=others)
        found = _balanced(base, lambda s, theta: _strength_at(s, theta, factor))[0]
    elif method == "force":
        base = slices.with_strength(0.0, others=others)
        found = _strength_at(base, np.zeros(slices.x.shape[:-1]), factor)[0]
    else:
        # Both factors of safety grow with S_r; that of the ordinary method in proportion.
        def excess(strength: np.ndarray) -> np.ndarray:
            changed = slices.with_strength(strength, others=others)
            if method == "ordinary":
                return ordinary(changed) - factor
            if circle is None:
                raise ValueError("Bishop's method needs the circle")
            return bishop(changed, circle) - factor

        found = _secant(excess, liquefied.shape)
    return np.where(liquefied > 0, found, np.nan)


def _secant(excess: Callable[[np.ndarray], np.ndarray], shape: tuple) -> np.ndarray:
    """Root of a function that is nearly linear, from 0 and 20 kPa, by secants."""
    low, high = np.zeros(shape), np.full(shape, 2e4)
    at_low, at_high = excess(low), excess(high)
    for _ in range(50):
        with np.errstate(divide="ignore", invalid="ignore"):
            new = high - at_high * (high - low) / (at_high - at_low)
        new = np.where(at_high == 0.0, high, new)
        low, at_low, high = high, at_high, new
        at_high = excess(high)
        if np.all(np.abs(high - low) <= 1e-9 * (1.0 + np.abs(high)) + 1e-6, where=~np.isnan(high)):
            break
    return high


def _last(value: float | np.ndarray) -> np.ndarray:
    """A number per slip surface, made to fit arrays whose last axis runs over slices."""
    value = np.asarray(value)
    return value[..., None] if value.ndim else value


def _ratio(resistance: np.ndarray, driving: np.ndarray) -> np.ndarray:
    """Resistance over driving force; nan where nothing drives the mass that way."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(driving > 0.0, resistance / driving, np.nan)


# --- Spencer ---


def _balanced(
    slices: Slices, solve: Callable[[Slices, np.ndarray], tuple[np.ndarray, np.ndarray]]
) -> tuple[np.ndarray, np.ndarray]:
    """The answer of `solve` at the inclination that balances the moments, and that inclination.

    Args:
        slices: of any number of slip surfaces.
        solve: gives, for inclinations of the forces between slices [rad], the answer (a factor of
            safety, or an S_r) that balances the forces, and the moment that is then left over.
    """
    shape = slices.x.shape[:-1]
    moments = np.stack([solve(slices, np.full(shape, theta))[1] for theta in INCLINATIONS])
    change = (
        np.isfinite(moments[1:]) & np.isfinite(moments[:-1]) & (moments[1:] * moments[:-1] <= 0)
    )
    # Where several roots exist, the one nearest to level forces between slices.
    nearness = np.abs(INCLINATIONS[1:] + INCLINATIONS[:-1]).reshape(-1, *[1] * len(shape))
    place = np.argmin(np.where(change, nearness, np.inf), axis=0)
    low, high = INCLINATIONS[place], INCLINATIONS[place + 1]
    at_low = np.take_along_axis(moments, place[None], axis=0)[0]
    for _ in range(45):
        middle = 0.5 * (low + high)
        moment = solve(slices, middle)[1]
        same = moment * at_low > 0
        low, at_low = np.where(same, middle, low), np.where(same, moment, at_low)
        high = np.where(same, high, middle)
    theta = 0.5 * (low + high)
    answer = solve(slices, theta)[0]
    found = change.any(axis=0)
    return np.where(found, answer, np.nan), np.where(found, theta, np.nan)


def _forces(slices: Slices, theta: np.ndarray) -> tuple[np.ndarray, ...]:
    """K . t, c l, tan phi x effective N without Q, and cosine and sine of (a - theta)."""
    cosine, sine = np.cos(slices.angle), np.sin(slices.angle)
    along = slices.weight * sine + slices.push * cosine
    normal = slices.weight * cosine - slices.push * sine - slices.pore * slices.length
    turned = slices.angle - _last(theta)
    return (
        along,
        slices.cohesion * slices.length,
        normal * slices.friction,
        np.cos(turned),
        np.sin(turned),
    )


def _between(
    slices: Slices, theta: np.ndarray, factor: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Q of every slice [N/m], without and per unit of S_r on the liquefied bases.

    From balance along and across the base with S = (c l + N' tan phi) / FS:
    Q = [(c l + N' tan phi)/FS - K . t] / [cos(a - theta) + sin(a - theta) tan phi / FS].
    """
    along, cohesive, frictional, cosine, sine = _forces(slices, theta)
    share = 1.0 / _last(factor)
    below = cosine + sine * slices.friction * share
    # A base so steep that the denominator vanishes has no meaning; the mass is then refused.
    below = np.where(below > 0.05, below, np.nan)
    force = ((cohesive + frictional) * share - along) / below
    return force, np.where(slices.liquefied, slices.length, 0.0) * share / below


def _moment(slices: Slices, theta: np.ndarray, force: np.ndarray) -> np.ndarray:
    """Moment that the forces between slices leave over [N]; nil in equilibrium."""
    theta = _last(theta)
    along = slices.downhill * (slices.x - slices.x.mean(axis=-1, keepdims=True))
    height = slices.base - slices.base.mean(axis=-1, keepdims=True)
    lever = -along * np.sin(theta) - height * np.cos(theta)
    water = slices.push_moment - slices.push * slices.base
    return np.sum(force * lever, axis=-1) + np.sum(water, axis=-1)


def _factor_at(slices: Slices, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Factor of safety that balances the forces at an inclination, and the moment left over."""
    low, high = np.full(theta.shape, 1e-3), np.full(theta.shape, 1e3)
    sum_high = _between(slices, theta, high)[0].sum(axis=-1)
    for _ in range(55):
        middle = np.sqrt(low * high)
        total = _between(slices, theta, middle)[0].sum(axis=-1)
        # Sum of Q falls as the factor rises; nan marks a factor too small for the steepest base.
        above = np.isnan(total) | (total > 0)
        low, high = np.where(above, middle, low), np.where(above, high, middle)
    factor = np.sqrt(low * high)
    force = _between(slices, theta, factor)[0]
    moment = _moment(slices, theta, force)
    return factor, np.where(sum_high < 0, moment, np.nan)


def _strength_at(slices: Slices, theta: np.ndarray, factor: float) -> tuple[np.ndarray, np.ndarray]:
    """S_r [Pa] that balances the forces at an inclination, and the moment left over."""
    force, per_strength = _between(slices, theta, np.full(theta.shape, factor))
    with np.errstate(divide="ignore", invalid="ignore"):
        strength = -force.sum(axis=-1) / per_strength.sum(axis=-1)
    total = force + per_strength * _last(strength)
    return strength, _moment(slices, theta, total)
