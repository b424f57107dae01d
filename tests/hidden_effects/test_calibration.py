"""Coverage and reliability, of judges whose calibration is known."""

import numpy as np
import pytest

from benchmarks.hidden_effects.scoring.calibration import (
    LEVELS,
    STATED,
    calibration,
    covers,
    in_band,
)
from benchmarks.hidden_effects.scoring.draw import reliability
from benchmarks.hidden_effects.scoring.intervals import Share
from benchmarks.hidden_effects.scoring.score import Judged
from tests.hidden_effects.judges import digest, perfect, truths


def judge(number: int, std: float, claimed: float, *, quoted: bool = True) -> list[Judged]:
    """Judges that err by `std` in ln S_r and claim `claimed`."""
    draw, row = np.random.default_rng(1), []
    for truth in truths(number):
        error = float(std * draw.standard_normal())
        said = digest(truth, "adequate", [], error=(error, error))
        value = said.final.values["strength"]
        final = said.final.model_copy(update={"std": {"strength": claimed * value}})
        ends = {
            level: tuple(float(value * np.exp(sign * wide * claimed)) for sign in (-1.0, 1.0))
            for level, (_, wide) in LEVELS.items()
        }
        more = {"quoted": {"strength": ends}} if quoted else {}
        row.append(Judged(truth, said.model_copy(update={"final": final, **more})))
    return row


@pytest.mark.parametrize("quoted", [True, False])
def test_an_honest_judge_is_in_the_band(quoted):
    found = calibration(judge(800, 0.1, 0.1, quoted=quoted)).coverage
    assert all(in_band(level, share) for level, share in found.items())
    assert found["50%"].value < found["80%"].value < found["95%"].value


def test_a_bold_judge_and_a_timid_one_are_not():
    bold = calibration(judge(800, 0.2, 0.1)).coverage
    timid = calibration(judge(800, 0.05, 0.1)).coverage
    for level, share in bold.items():
        assert not in_band(level, share) and share.value < LEVELS[level][0]
    for level, share in timid.items():
        assert not in_band(level, share) and share.value > LEVELS[level][0]
    assert in_band("95%", Share(0, 0)) is None


def test_what_is_quoted_counts_and_not_the_final_model():
    (one,) = judge(1, 0.0, 0.1)
    assert covers(one, "50%")
    off = {"strength": dict.fromkeys(LEVELS, (1e-3, 2e-3))}
    moved = Judged(one.truth, one.digest.model_copy(update={"quoted": off}))
    assert not covers(moved, "95%")


def test_reliability_is_by_stated_probability():
    """Right in 7 of 10 where 0.7 is stated, never where 0.1 is, always where 1 is."""
    row = []
    for k, truth in enumerate(t for t in truths(80) if t["kind"] == "single"):
        (name,) = truth["effects"]
        other = "effect_0" if name != "effect_0" else "effect_1"
        sets = [[name], [other]] if k % 10 < 7 else [[other], ["third"]]
        said = digest(truth, "ambiguous", [], sets=sets).model_copy(update={"shares": [0.7, 0.1]})
        row.append(Judged(truth, said))
    row.append(Judged(truth, perfect(truth).model_copy(update={"shares": [1.0]})))
    row = row[:30] + row[-1:]
    found = dict(zip(STATED[1:], calibration(row).reliability, strict=True))
    assert found[0.8].stated == 0.7 and found[0.8].right == Share(21, 30)
    assert found[0.2].stated == 0.1 and found[0.2].right == Share(0, 30)
    assert found[1.0].stated == 1.0 and found[1.0].right == Share(1, 1)
    assert found[0.5].stated is None and found[0.5].right.n == 0
    # A record of an earlier version has no probabilities, and says nothing.
    old = [Judged(one.truth, one.digest.model_copy(update={"shares": []})) for one in row]
    assert all(one.right.n == 0 for one in calibration(old).reliability)


def test_a_null_that_is_left_alone_is_right():
    null = next(t for t in truths(8) if t["kind"] == "null")
    said = digest(null, "adequate", [], sets=[[]]).model_copy(update={"shares": [0.9]})
    assert calibration([Judged(null, said)]).reliability[3].right == Share(1, 1)


def test_the_diagram_is_drawn(tmp_path):
    path = reliability(tmp_path / "calibration.png", calibration(judge(40, 0.2, 0.1)))
    assert path.stat().st_size > 5000
