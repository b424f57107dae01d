"""Step 7, where: the place of a thing that may lie anywhere, such as a part of another strength.

A few places have names of their own and stand among the candidates from the beginning. The best of
them that was refitted is moved: each of its neighbours, one side a step farther in or out, is run
once where *this* place fits, and the one that promises most becomes a candidate with a refit of its
own, till none promises more. A strong contrast is no sum of what weak ones do, so a place is judged
by runs at the amplitude that was found.

A place that was sought among many is found by chance more easily than one that was given: the
evidence of a model pays the logarithm of their number.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from diagnosis.adequacy.adequacy import judged
from diagnosis.hypotheses.model import Seeking
from diagnosis.selection.explain import with_candidate
from diagnosis.selection.refit import ANCHORED, JUDGES, LEVEL, FittedModel, refit
from diagnosis.selection.selection import Selection
from diagnosis.signatures.signatures import take_signatures
from inversion.estimation.misfit import total_of
from inversion.estimation.response_surface import Surface
from pipeline.ties import largest

#: Times that a thing is moved, a run of each of up to 12 neighbours and a refit each. By judgement:
#: one side of a part crosses half of the strips, all of the layers.
MOVES = 4
#: A given place is moved if it takes this share off the sum of squares that the best single does.
#: By judgement: a better place is not expected to double what a thing explains.
WORTH = 0.5


def seek_places(selection: Selection, models: list[FittedModel]) -> list[FittedModel]:
    """Move the best of the single effects that are at a place.

    Args:
        selection: under way.
        models: refitted, among them single effects at given places.

    Returns:
        all of them, and those at better places.
    """
    model = selection.runs.model
    known = selection.explanation.known
    singles = [one for one in models if len(one.names) == 1 and not one.unread]
    placed = [one for one in singles if known[one.names[0]].placed]
    if not placed or not isinstance(model, Seeking):
        return models
    falls = {one.names: selection.base.fit.total - one.fit.total for one in singles}
    now = largest(placed, lambda one: falls[one.names])
    if falls[now.names] < WORTH * max(falls.values()):
        return models
    found = list(models)
    for _ in range(MOVES):
        moved = _moved(selection, model, now)
        if moved is None:
            break
        # The same C for both: the errors of this place may have been found, those of that not.
        data = selection.explanation.context.of(moved).data
        here = total_of(data, now.fit.space, now.fit.prediction, now.fit.x)
        if moved.fit.total > here - LEVEL:
            break
        now = moved
        found.append(now)
    return found


def _moved(selection: Selection, model: Seeking, now: FittedModel) -> FittedModel | None:
    """The neighbour that promises most, refitted; None where none promises enough."""
    (name,) = now.names
    fit, runs = now.fit, selection.runs
    amplitude = fit.space.amplitudes(fit.x)[name]
    known = selection.explanation.known
    there = [
        other
        for other in model.neighbours(name)
        if other not in known
        and other not in selection.options.forbidden
        and model.add_placed(other) is not None
    ]
    own = replace(fit.space.state(fit.x, seed=JUDGES[0][0]), effects=())
    states = [own.with_effects({one: amplitude}) for one in (name, *there)]
    best = None
    if there and runs.affords(states, f"places near {name}"):
        rows = runs.predict(states)
        # Cells have been measured at this place alone; the neighbours have what they do here.
        cells = selection.comparison.base.cells
        rows = np.array(
            [
                row + cells.of(states[0]) - cells.of(one)
                for one, row in zip(states, rows, strict=True)
            ]
        )
        found = judged(selection.explanation.context.of(now).data, fit, draws=1, seed=0)
        drops = {}
        for other, row in zip(there, rows[1:], strict=True):
            if np.all(np.isfinite(row - rows[0])):
                s = found.system.project(found.system.augmented(row - rows[0]))
                drops[other] = float(2.0 * s @ found.residual - s @ s)
        drops = {other: drop for other, drop in drops.items() if drop > LEVEL}
        best = largest(drops, drops.__getitem__) if drops else None
    model.drop_placed([other for other in there if other != best])
    return None if best is None else _refitted(selection, model, now, best)


def _refitted(
    selection: Selection, model: Seeking, now: FittedModel, name: str
) -> FittedModel | None:
    """The thing at another place, refitted from where it fits at this one."""
    comparison, options = selection.comparison, selection.options
    before = selection.explanation.known[now.names[0]]
    candidate = model.add_placed(name, choices=before.placed)
    if candidate is None:
        return None
    taken = take_signatures(
        selection.runs,
        comparison.base.surface,
        comparison.judged.system,
        [candidate],
        finite=options.finite_amplitudes,
        turns=1,
    )
    if name not in taken:
        return None
    selection.explanation = with_candidate(
        selection.explanation, comparison, options, candidate, taken[name]
    )
    selection.signatures[name] = taken[name]
    context, fit = selection.explanation.context, now.fit
    # What it changes and how the parameters act there is much the same: only the place is new.
    surface = selection.base.surface.with_ladders({name: taken[name].ladder})
    base = replace(selection.base, surface=surface)
    selection.tried.models[()] = selection.tried.way[0].model = base
    surface = Surface(context.space((name,)), fit.x, fit.prediction, fit.derivative)
    found = refit(context, surface, (name,), seeds=ANCHORED, near=fit.x)
    if found is None:
        return None
    selection.tried.models[found.names] = found
    return selection.judged(found.names)
