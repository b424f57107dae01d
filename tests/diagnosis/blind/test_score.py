"""The score of judges whose skill is known: a perfect one, a blind one, a biased one."""

import numpy as np
import pytest

from diagnosis.blind.digest import Digest, StageDigest
from diagnosis.blind.score import Judged, score

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
        }  # fmt: skip


def digest(
    truth, verdict, names, *, sets=None, error=(0.2, 0.02), held_out=(9.0, 4.0), nearest=0.5
):
    def stage(relative, chi2):
        value = truth["parameters"]["strength"] * np.exp(relative)
        return StageDigest(values={"strength": value}, std={"strength": 0.05 * value}, chi2=10.0,
                           dof=10, p=0.5, held_out_chi2=chi2, held_out_n=4)  # fmt: skip

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


def test_a_perfect_judge():
    found = score([Judged(t, perfect(t), True if t["kind"] == "outside" else None)
                   for t in truths(400)])  # fmt: skip
    whole = ("precision", "precision_all_kinds", "named_25", "named_60", "set_holds_truth",
             "held_out_falls", "strength_within_2_std", "pair_exact",
             "curve_recovered")  # fmt: skip
    assert found.counts == {"single": 150, "null": 150, "pair": 50, "outside": 50}
    for name in whole:
        assert found.shares[name].value == 1.0, name
    for name in ("false_attribution", "false_alarm", "explained_away"):
        assert found.shares[name].value == 0.0, name
    assert all(share.value == 1.0 for share in found.bins["named"])
    assert sum(share.n for share in found.bins["named"]) == 150
    assert found.medians["strength_error_base"] == pytest.approx(0.2)
    assert found.medians["strength_error_final"] == pytest.approx(0.02)


def test_a_judge_that_draws_a_name_for_every_case():
    """One of ten names is right one time in ten; every null is accused; no pair is found."""
    draw = np.random.default_rng(1)
    found = score([Judged(t, digest(t, "identified", [str(draw.choice(EFFECTS))]))
                   for t in truths(1600)])  # fmt: skip
    assert found.shares["false_attribution"].value == 1.0
    assert found.shares["explained_away"].value == 1.0
    assert found.shares["pair_exact"].value == 0.0
    low, high = found.shares["named_25"].interval
    assert low < 0.1 < high
    assert found.shares["precision"].n == 1200  # nulls count against it
    assert found.shares["precision"].value == pytest.approx(0.05, abs=0.02)


def test_a_judge_that_sees_a_favourite_everywhere():
    found = score([Judged(t, digest(t, "identified", [EFFECTS[0]])) for t in truths(800)])
    mine = [t for t in truths(800) if t["kind"] == "single" and EFFECTS[0] in t["effects"]]
    assert found.shares["precision_all_kinds"].hits == len(mine)
    assert sum(share.hits for share in found.bins["wrong_name"]) == 300 - len(mine)


def test_a_judge_that_is_silent():
    """It accuses no null, and names nothing: silence is no skill."""
    found = score([Judged(t, digest(t, "adequate", [], sets=[[]])) for t in truths(80)])
    assert found.shares["false_alarm"].value == 0.0
    assert found.shares["named_25"].value == 0.0
    assert found.shares["precision"].n == 0
    assert found.medians["strength_error_final"] is None


def test_look_alikes_are_asked_for_a_set():
    """Where a rival looks the same, both in one set is right, and no name is asked for."""
    judged = [
        Judged(t, digest(t, "ambiguous", [min(t["effects"])],
                         sets=[[min(t["effects"])], ["rival"]], nearest=0.98))
        for t in truths(80) if t["kind"] == "single"
    ]  # fmt: skip
    found = score(judged)
    assert found.shares["named_25"].n == 0
    assert found.shares["set_of_three_25"].value == 1.0
    assert all(share.value == 1.0 for share in found.bins["named_or_set"])


def test_a_set_of_four_is_no_answer():
    truth = next(t for t in truths(8) if t["kind"] == "single")
    name = min(truth["effects"])
    four = [[name], ["a"], ["b"], ["c"]]
    one = Judged(truth, digest(truth, "ambiguous", [name], sets=four, nearest=0.98))
    assert one.set_holds
    assert not one.useful_set


def test_the_names_of_a_pair_hold_one_of_its_effects_only_half():
    truth = next(t for t in truths(8) if t["kind"] == "pair")
    one = score([Judged(truth, digest(truth, "identified", [min(truth["effects"])]))])
    assert one.shares["pair_exact"].value == 0.0
    assert one.shares["pair_half"].value == 1.0


def test_a_strength_beyond_two_standard_deviations_is_told():
    truth = next(t for t in truths(8) if t["kind"] == "single")
    off = Judged(truth, digest(truth, "identified", sorted(truth["effects"]), error=(0.2, 0.15)))
    assert score([off]).shares["strength_within_2_std"].value == 0.0


def test_a_worse_prediction_of_what_was_held_out_is_told():
    truth = next(t for t in truths(8) if t["kind"] == "single")
    names = sorted(truth["effects"])
    worse = Judged(truth, digest(truth, "identified", names, held_out=(4.0, 9.0)))
    assert score([worse]).shares["held_out_falls"].value == 0.0
