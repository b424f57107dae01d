"""A diagnosis of what did not flow: a limit costs nothing while it is kept, and alone it is met."""

from __future__ import annotations

import shutil

import numpy as np
import pytest
import yaml

from benchmarks.hidden_effects.example import write_survey
from benchmarks.hidden_effects.making.sections import load_section
from diagnosis.case import diagnosis_case
from diagnosis.verdict.verdict import load_verdict
from geometry.case import load_case
from inversion.problem.state import state
from report.sentences.finding import headline
from tests.commands import diagnose as main
from tests.diagnosis.test_commands import ASKED, HIDDEN, QUICK

LIMIT = 1.0
TRUTH = (9.2, 33.0)


@pytest.fixture(scope="module")
def folder(root, tmp_path_factory, kept_runs):
    """The example, surveyed after a slide over a weak base; its other side stood."""
    folder = tmp_path_factory.mktemp("case") / "embankment"
    shutil.copytree(root / "docs" / "examples" / "hidden_effect", folder)
    (folder / "diagnosis.yaml").write_text(ASKED)
    model = diagnosis_case(load_case(folder)).model(kept_runs)
    (measured,) = model.predict([state(TRUTH, HIDDEN, seed=11)])
    places = np.loadtxt(folder / "profile.csv", delimiter=",", skiprows=1)[:, 0]
    write_survey(load_section(folder), folder, np.round(measured, 3), places)
    path = folder / "measurements.yaml"
    survey = yaml.safe_load(path.read_text())
    (entries,) = survey["sets"].values()
    (ran,) = {entry["side"] for entry in entries if "side" in entry}
    entries.append(
        {"name": "other side", "type": "no_flow", "side": "left" if ran == "right" else "right",
         "limit_m": LIMIT, "std_m": 0.5, "confidence": "published", "source": "a test"}
    )  # fmt: skip
    path.write_text(yaml.safe_dump(survey))
    return folder


def test_a_kept_limit_is_predicted_as_the_limit_and_a_broken_one_as_it_is(
    folder, kept_runs, tmp_path
):
    wrong = tmp_path / "embankment"
    shutil.copytree(folder, wrong)
    survey = yaml.safe_load((wrong / "measurements.yaml").read_text())
    (entries,) = survey["sets"].values()
    entries[-1]["side"] = next(entry["side"] for entry in entries if "side" in entry)
    (wrong / "measurements.yaml").write_text(yaml.safe_dump(survey))
    for place, broken in ((folder, False), (wrong, True)):
        model = diagnosis_case(load_case(place)).model(kept_runs)
        number, toe = (model.targets.names.index(name) for name in ("other side", "toe"))
        assert model.targets.censored[number] and model.targets.fitted[number]
        (found,) = model.predict([state(TRUTH)])
        assert found[toe] > LIMIT + 5.0
        # From the toe of the points before the slide, which the foot of a gentle slope is short of.
        assert found[number] >= found[toe] if broken else found[number] == LIMIT


@pytest.fixture(scope="module")
def stood(folder, tmp_path_factory):
    """The same section, of which only is known that neither side ran."""
    place = tmp_path_factory.mktemp("stood") / "embankment"
    shutil.copytree(folder, place)
    survey = yaml.safe_load((place / "measurements.yaml").read_text())
    survey["sets"] = {"survey": [
        {"name": f"{side} side", "type": "no_flow", "side": side, "limit_m": LIMIT, "std_m": 0.5,
         "confidence": "published", "source": "a test"}
        for side in ("left", "right")
    ]}  # fmt: skip
    (place / "measurements.yaml").write_text(yaml.safe_dump(survey))
    return place


def test_of_limits_alone_that_which_is_broken_first_counts_as_measured(stood, kept_runs):
    targets = diagnosis_case(load_case(stood)).model(kept_runs).targets
    assert targets.names[targets.met] == "left side", "the side that ran"
    raw = np.array([[0.2, 0.7], [0.9, 0.1], [1.4, 0.3], [1.4, 2.0]])
    met = np.array([[0.2, LIMIT], [0.9, LIMIT], [1.4, LIMIT], [1.4, 2.0]])
    np.testing.assert_array_equal(targets.counted(raw), met)


@pytest.mark.slow
def test_of_a_slope_that_stood_a_lower_bound_is_quoted(stood, kept_runs, tmp_path, capsys):
    assert not main(["run", str(stood), "--out", str(tmp_path), *QUICK])
    assert "quoted" in (said := capsys.readouterr().out) and "≥" in said and "< 1.00 m" in said
    verdict = load_verdict(tmp_path)
    found = verdict.quoted["residual_strength"]
    assert verdict.verdict == "adequate" and "Nothing ran" in headline(verdict)
    assert verdict.quoted["friction_fill"].at_least is None, "a bound is one of a strength"
    model = diagnosis_case(load_case(stood)).model(kept_runs)
    friction = verdict.base.values["friction_fill"]
    at, weaker = (
        np.mean(model.predict([state((value, friction), seed=seed) for seed in range(4)])[:, 0])
        for value in (found.value, 0.75 * found.value)
    )
    # The limit is told in small cells, where more runs than in these runs.
    assert at < LIMIT + 0.5, "at the limit nothing runs farther"
    assert weaker > LIMIT + 0.5, "with a quarter less it runs"
    assert 0.6 * found.value < found.at_least < found.value


@pytest.mark.slow
def test_a_hidden_effect_is_found_with_a_limit_among_the_data(folder, tmp_path, capsys):
    assert not main(["run", str(folder), "--out", str(tmp_path), *QUICK])
    verdict = load_verdict(tmp_path)
    (line,) = [one for one in verdict.measurements if one.name == "other side"]
    assert line.residual_base == 0.0 and line.measured == LIMIT
    assert list(verdict.final.effects) == ["weak_base"]
    assert not main(["suggest", str(folder), "--out", str(tmp_path), *QUICK])
    assert "no_flow" not in capsys.readouterr().out, "a toe_runout says more"
