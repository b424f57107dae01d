"""Stress of a point after a step: volume averaged over a cell (F-bar), then the material law.

The cell of F-bar is the knot span around a node, in which the velocity is one polynomial. Arrays
and columns: `layout`.
"""

# No `from __future__ import annotations` here: Taichi reads the annotations as objects.

from types import SimpleNamespace

import taichi as ti

from mpm_taichi.layout import (
    CLOSED_POINTS,
    DISSIPATED,
    DIVERGENCE,
    DVX_DX,
    DVX_DY,
    DVY_DX,
    DVY_DY,
    MEAN_STRESS,
    OPENING,
    SHEAR,
    SMOOTHED,
    VOLUMETRIC,
    XX,
    YY,
    ZZ,
    A,
    vec4,
)
from mpm_taichi.materials.elasticity import CENTRE, OUT, larger, smaller
from mpm_taichi.materials.law import MaterialLaw


@ti.func
def cell_means(sums):
    """Means over the closed points of a cell from the sums over them (`cell_sums`)."""
    means = sums
    means[DIVERGENCE] /= sums[CLOSED_POINTS]
    means[MEAN_STRESS] /= sums[CLOSED_POINTS]
    return means


@ti.func
def smooth_pressure(own, below, above, left, right, smoothing):
    """Mean stress of a cell, drawn towards a line through its neighbours above and to the sides.

    Each argument but the last is a row of `cell_means`. Cells of quadratic splines can alternate in
    pressure without any force noticing; a linear pressure, as weight gives, is left as it is.
    A direction counts only where both neighbours hold closed points.
    """
    bend = 0.0
    if ti.min(below[CLOSED_POINTS], above[CLOSED_POINTS]) > 0.0:
        bend += 0.25 * (2.0 * own[MEAN_STRESS] - below[MEAN_STRESS] - above[MEAN_STRESS])
    if ti.min(left[CLOSED_POINTS], right[CLOSED_POINTS]) > 0.0:
        bend += 0.25 * (2.0 * own[MEAN_STRESS] - left[MEAN_STRESS] - right[MEAN_STRESS])
    return own[MEAN_STRESS] - smoothing * bend


@ti.func
def area_rate(gradient, dt):
    """Rate at which area grows in a step [1/s], to second order: (det(I + dt L) - 1) / dt.

    The first order alone lets a mass that turns grow by (dt spin)^2 a step.
    """
    determinant = gradient[DVX_DX] * gradient[DVY_DY] - gradient[DVY_DX] * gradient[DVX_DY]
    return gradient[DVX_DX] + gradient[DVY_DY] + dt * determinant


@ti.func
def strain_increment(gradient, opened, means, dt, averaged: ti.template()):
    """Volumetric strain increment of a point: its own, or the mean over its cell (F-bar).

    A point that has opened goes by its own: it moves freely, and its cell must not feel it.
    """
    divergence = area_rate(gradient, dt)
    if ti.static(averaged):
        shared = (opened <= 0.0) & (means[CLOSED_POINTS] > 0.0)
        divergence = ti.select(shared, means[DIVERGENCE], divergence)
    return dt * divergence


@ti.func
def pressure_relief(stress, opened, means, share, averaged: ti.template()):
    """Change of mean stress [Pa] that brings a point nearer to its cell's smoothed mean.

    Without it, pressures that differ within a cell would drive its points apart for ever, since
    F-bar hides their own volume change from them. Opened points neither give nor take.
    """
    relief = 0.0
    if ti.static(averaged):
        lack = means[SMOOTHED] - (stress[XX] + stress[YY] + stress[ZZ]) * (1.0 / 3.0)
        relief = ti.select((opened <= 0.0) & (means[CLOSED_POINTS] > 0.0), share * lack, 0.0)
    return relief


@ti.func
def cell_sums(gradient, stress, opened, dt):
    """Contribution of a closed point to the sums of its cell: (divergence, 0, mean stress, 1)."""
    closed = ti.select(opened <= 0.0, 1.0, 0.0)
    mean_stress = (stress[XX] + stress[YY] + stress[ZZ]) * (1.0 / 3.0)
    return closed * vec4(area_rate(gradient, dt), 0.0, mean_stress, 1.0)


def stress_functions(
    law: MaterialLaw, *, averaged: bool = False, corrected: bool = False, relieved: bool = True
) -> SimpleNamespace:
    """The functions of a point's stress: of the law, and `advance`, which takes it through a step.

    Args:
        law: the material law.
        averaged: volumetric strain increments averaged over a cell (F-bar).
        corrected: volume correction at the free surface: soil that opened (tension cap) must close
            again before it resists. Otherwise each opening and closing would leave volume behind.
        relieved: `pressure_relief` takes part.
    """
    elastic_trial, ordinary, unusual = law.trial, law.usual_return, law.rare_return
    one_return, evened = unusual is None, averaged and relieved
    if law.variables:
        usual_return, rare_return = ordinary, unusual
    else:

        @ti.func
        def usual_return(trial, elastic, strength, variables: A):
            return ordinary(trial, elastic, strength)

        @ti.func
        def rare_return(trial, elastic, strength, variables: A):
            return unusual(trial, elastic, strength)

    @ti.func
    def trial(old, gradient, opened, means, step: A, elastic):
        """Trial stress of the law, strain increment [-] and what is still open [-]."""
        strain = strain_increment(gradient, opened, means, step.dt, averaged)
        relief = pressure_relief(old, opened, means, step.share, evened)
        left = opened
        if ti.static(corrected):
            closing = larger(smaller(opened, -strain), 0.0)
            left -= closing
            strain += closing
        result = elastic_trial(old, gradient, strain, step.dt, elastic)
        result[CENTRE] += relief
        result[OUT] += relief
        return result, strain, left

    @ti.func
    def return_to_yield(tried, elastic, strength, variables: A):
        """Stress, plastic shear strain, opening and work of a step: usual or rare return."""
        before = variables
        new, shear, work, elsewhere = usual_return(tried, elastic, strength, variables)
        opening = 0.0
        if ti.static(not one_return):
            if elsewhere > 0.0:
                if ti.static(law.variables > 0):
                    variables = before
                new, shear, opening, work = rare_return(tried, elastic, strength, variables)
        return new, shear, opening, work

    @ti.func
    def advance(p, step: A, points: A, means, elastic, strength, variables: A):
        """Stress and history of a point after a step, and its plastic shear strain in the step."""
        old = points.history[p]
        tried, strain, opened = trial(
            points.stress[p], points.gradient[p], old[OPENING], means, step, elastic
        )
        new, shear, opening, work = return_to_yield(tried, elastic, strength, variables)
        if ti.static(corrected):
            opened += opening
            strain -= opening
        history = vec4(
            old[VOLUMETRIC] + strain,
            opened,
            old[SHEAR] + shear,
            old[DISSIPATED] + work * points.volume[p] * (1.0 + old[VOLUMETRIC]),
        )
        return new, history, shear

    return SimpleNamespace(
        trial=trial,
        usual_return=usual_return,
        rare_return=rare_return,
        return_to_yield=return_to_yield,
        advance=advance,
    )
