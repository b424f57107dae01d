"""The score of judges whose skill is known: a perfect one, a blind one, a biased one."""

import numpy as np
import pytest

from benchmarks.hidden_effects.making.benchmark import Bound, load_plan
from benchmarks.hidden_effects.scoring.intervals import Share
from benchmarks.hidden_effects.scoring.score import Judged, Score, broken, score
from pipeline.cli import InputError
from tests.hidden_effects.judges import EFFECTS, digest, perfect, truths


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


def test_an_alarm_is_a_base_model_called_inadequate():
    """A small p alone is an alarm and no attribution; a name with a fair p is the reverse."""
    nulls = [t for t in truths(80) if t["kind"] == "null"]
    said = [digest(t, "suspect", [], sets=[[]], p=0.04) for t in nulls[:6]]
    said += [digest(t, "identified", ["effect_1"], p=0.06) for t in nulls[6:9]]
    said += [digest(t, "ambiguous", [], sets=[[]], p=0.3) for t in nulls[9:10]]  # no effect in it
    said += [digest(t, "adequate", [], sets=[[]], p=0.3) for t in nulls[10:]]
    found = score([Judged(t, d) for t, d in zip(nulls, said, strict=True)])
    assert (found.shares["false_alarm"].hits, found.shares["false_alarm"].n) == (6, 30)
    assert (found.shares["false_attribution"].hits, found.shares["false_attribution"].n) == (3, 30)


def test_bins_count_their_own_cases():
    """Named from lambda 25 on, silent below: each bin says what happened in it."""
    judged = [
        Judged(t, perfect(t) if t["lambda"] >= 25.0 else digest(t, "adequate", [], sets=[[]]))
        for t in truths(400) if t["kind"] == "single"
    ]  # fmt: skip
    found = score(judged)
    for name in ("named", "named_or_set", "right", "alarm", "set_holds"):
        assert [share.value for share in found.bins[name]] == [0.0, 0.0, 1.0, 1.0], name
    for number, (low, high) in enumerate([(3, 10), (10, 25), (25, 60), (60, 201)]):
        own = [one for one in judged if low <= one.seen < high]
        assert found.bins["alarm"][number].n == len(own)
    beyond = [one for one in judged if one.seen >= 60.0]
    assert found.shares["named_60"].n == len(beyond) and found.shares["named_60"].value == 1.0


def test_the_strength_of_all_singles_is_reported_next_to_that_of_the_right_ones():
    singles = [t for t in truths(80) if t["kind"] == "single"]
    judged = [Judged(t, digest(t, "adequate", [], sets=[[]], error=(0.3, 0.3))) for t in singles]
    judged[:10] = [Judged(t, perfect(t)) for t in singles[:10]]
    found = score(judged)
    assert found.medians["strength_error_final"] == pytest.approx(0.02)
    assert found.medians["strength_error_final_all"] == pytest.approx(0.3)


def test_a_curve_counts_where_there_was_one_to_be_found():
    strangers = [t for t in truths(80) if t["kind"] == "outside"]
    outcomes = [True, False, None, True, None, True, True, False, False, True]
    judged = [
        Judged(t, digest(t, "unknown_effect", [], sets=[]), outcome)
        for t, outcome in zip(strangers, outcomes, strict=True)
    ]
    share = score(judged).shares["curve_recovered"]
    assert (share.hits, share.n) == (5, 8)


def test_a_stranger_under_its_own_name_is_not_explained_away():
    """The library has spatial variability too, but not the fields that were hidden."""
    strangers = [t for t in truths(96) if t["kind"] == "outside"]
    own = [{**t, "effects": {"effect_0": 0.5}} for t in strangers]
    said = [digest(t, "identified", ["effect_0"]) for t in own]
    said[0] = digest(own[0], "identified", ["effect_0", "effect_1"], sets=[["effect_0"]])
    share = score([Judged(t, d) for t, d in zip(own, said, strict=True)]).shares["explained_away"]
    assert (share.hits, share.n) == (1, len(strangers))


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
    """It accuses no null and names nothing: silence is not skill."""
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


def test_a_strength_beyond_two_standard_deviations_is_reported():
    truth = next(t for t in truths(8) if t["kind"] == "single")
    off = Judged(truth, digest(truth, "identified", sorted(truth["effects"]), error=(0.2, 0.15)))
    assert score([off]).shares["strength_within_2_std"].value == 0.0


def test_a_worse_prediction_of_what_was_held_out_is_reported():
    truth = next(t for t in truths(8) if t["kind"] == "single")
    names = sorted(truth["effects"])
    worse = Judged(truth, digest(truth, "identified", names, held_out=(4.0, 9.0)))
    assert score([worse]).shares["held_out_falls"].value == 0.0


def test_pairs_are_counted_by_the_fainter_next_to_the_other():
    row = [t for t in truths(160) if t["kind"] == "pair"]
    found = score([Judged(t, perfect(t)) for t in row])
    each = [sum(low <= t["beside"] < high for t in row) for low, high in ((3, 10), (10, 25))]
    assert [share.n for share in found.bins["pair_exact"][:2]] == each
    assert found.shares["pair_exact_25"].n == sum(t["beside"] >= 25.0 for t in row) > 0
    assert found.shares["pair_exact_25"].value == found.shares["pair_exact"].value == 1.0


def test_a_law_that_runs_alike_is_told_apart_from_being_explained_away():
    row = [t for t in truths(64) if t["kind"] == "outside"]
    said = [digest(t, "identified", ["effect_0"]) for t in row]
    found = score(
        [Judged(t, d, False, k % 2 == 0) for k, (t, d) in enumerate(zip(row, said, strict=True))]
    )
    assert found.shares["explained_away"].value == 1.0
    assert found.shares["explained_unlike"].value == found.shares["law_found"].value == 0.5
    assert found.shares["curve_recovered"].value == 0.0
    seen = [t["lambda"] >= 25.0 for t in row]
    assert 0 < found.shares["law_found_25"].n == sum(seen) < len(row)
    assert found.shares["law_found_25"].hits == sum(seen[::2])


def test_a_broken_promise_is_named():
    shares = {"false_alarm": Share(2, 3), "named_25": Share(1, 4)}
    found = Score(shares, {}, {}, {})
    assert broken({"false_alarm": Bound(at_most=2), "named_25": Bound(at_least=1)}, found) == []
    lines = broken({"false_alarm": Bound(at_most=1), "named_25": Bound(at_least=2)}, found)
    assert lines == ["false_alarm: 2 of 3, at most 1", "named_25: 1 of 4, at least 2"]
    with pytest.raises(InputError, match="promises: alarms: allowed are false_alarm, named_25"):
        broken({"alarms": Bound(at_most=1)}, found)


def test_the_slice_of_continuous_integration_promises_figures_that_exist(root):
    plan = load_plan(root / "benchmarks/hidden_effects/slice.yaml")
    assert plan.promises and broken(plan.promises, score([])) != []
