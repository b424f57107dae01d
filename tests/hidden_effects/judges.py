"""Made-up truths, and judges whose skill is known."""

import numpy as np

from benchmarks.hidden_effects.scoring.digest import Digest, StageDigest

EFFECTS = [f"effect_{k}" for k in range(10)]


def truths(number, seed=0):
    """Cases of all kinds; lambda evenly in the logarithm from 3 to 200."""
    draw = np.random.default_rng(seed)
    for k in range(number):
        kind = ("single", "null", "single", "null", "single", "null", "pair", "outside")[k % 8]
        n = {"single": 1, "null": 0, "pair": 2, "outside": 0}[kind]
        names = [str(name) for name in draw.choice(EFFECTS, n, replace=False)]
        if kind == "outside":
            names = ["stranger"]
        seen = 0.0 if kind == "null" else float(np.exp(draw.uniform(np.log(3), np.log(200))))
        yield {
            "kind": kind,
            "effects": {name: 1.0 for name in names},
            "parameters": {"strength": float(draw.uniform(10, 40))},
            "lambda": seen,
            **({"beside": seen / 2.0} if kind == "pair" else {}),
        }  # fmt: skip


def digest(
    truth,
    verdict,
    names,
    *,
    sets=None,
    error=(0.2, 0.02),
    held_out=(9.0, 4.0),
    nearest=0.5,
    p=None,
):
    """What a judge says; `p` of the base model, by default below 0.05 where it is not adequate."""
    if p is None:
        p = 0.5 if verdict == "adequate" else 0.01

    def stage(relative, chi2):
        value = truth["parameters"]["strength"] * np.exp(relative)
        return StageDigest(values={"strength": value}, std={"strength": 0.05 * value}, chi2=10.0,
                           dof=10, p=p, held_out_chi2=chi2, held_out_n=4)  # fmt: skip

    return Digest(
        case="x", verdict=verdict, effects={name: 1.0 for name in names},
        set_90=[list(names)] if sets is None else sets,
        base=stage(error[0], held_out[0]), final=stage(error[1], held_out[1]),
        nearest={name: nearest for name in EFFECTS}, scores={}, curve=None, runs=100,
        cut_short=[], seconds=1.0,
    )  # fmt: skip


def perfect(truth):
    names = sorted(truth["effects"])
    if truth["kind"] == "null":
        return digest(truth, "adequate", [], error=(0.02, 0.02))
    if truth["kind"] == "outside":
        return digest(truth, "unknown_effect", [], sets=[])
    return digest(truth, "identified", names)
