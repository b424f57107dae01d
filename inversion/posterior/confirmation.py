"""Does the solver bear out a posterior that a learned model found? Runs at some of its draws.

Draws that lie far from each other are simulated by the material point method; what a fitted number
is there is compared with what the emulator of the learned model predicts, whose error it has stated
before.
"""

from __future__ import annotations

import numpy as np

from inversion.posterior.document import ConfirmedNumber
from inversion.posterior.infer import AnyModel, Inferred
from inversion.posterior.runs import EmulatedModel
from inversion.posterior.sampling import spread_out

#: A mean difference beyond so many standard deviations of what was stated is one too many.
FAR = 2.0


def confirmed(
    found: Inferred[AnyModel], solver: EmulatedModel, number: int
) -> tuple[list[ConfirmedNumber], list[str]]:
    """Each fitted number at some draws by the solver, and a line on each that it does not bear out.

    Args:
        found: by a learned model.
        solver: the same case by the material point method.
        number: of the draws.
    """
    emulator, targets = found.likelihood.emulator, found.inference.targets
    values = found.values[spread_out(emulator.scaled(found.values), number)]
    simulated = solver.run(values, coarse=False)
    mean, std = emulator.predict(values)
    numbers, lines = [], []
    for place in np.flatnonzero(targets.fitted):
        name = targets.names[place]
        column = found.inference.names.index(name)
        own = np.hypot(std[:, column], found.inference.engine_std[column])
        apart = simulated[:, solver.names.index(name)] - mean[:, column]
        known = np.isfinite(apart)
        if not known.any():
            lines.append(f"{name}: no run of the solver at draws of the posterior could be read")
            continue
        stated = float(np.sqrt(np.mean(own[known] ** 2)))
        one = ConfirmedNumber(
            name=name,
            runs=int(known.sum()),
            difference=round(float(apart[known].mean()), 4),
            scatter=round(float(apart[known].std()), 4),
            stated_std=round(stated, 4),
        )
        numbers.append(one)
        # All draws share what the model does wrong, so their mean is no better than one of them.
        if abs(one.difference) > FAR * stated:
            lines.append(
                f"{name}: the solver differs by {one.difference:+.3g} on average at "
                f"{one.runs} draws of the posterior, more than the model's error of {stated:.2g} "
                "allows: ask the engine mpm"
            )
    return numbers, lines
