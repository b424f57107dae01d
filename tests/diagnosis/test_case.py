"""A case folder made into a question: files that are read, and files refused in one line."""

from __future__ import annotations

import shutil
from dataclasses import replace

import numpy as np
import pytest
import yaml

from diagnosis.adequacy.calibration import calibrate
from diagnosis.adequacy.compare import compare
from diagnosis.case import diagnosis_case
from diagnosis.hypotheses.hypothesis_file import Hypothesis
from diagnosis.verdict.fitted_models import fitted_to_part
from geometry.case import load_case
from inversion.engines.run_store import RunStore
from inversion.estimation.hold_out import HoldOut
from inversion.estimation.misfit import system
from pipeline.cli import InputError
from pipeline.config import Config, load_config

#: Outline of the fill without its top two metres.
LOWER = [[10, 5], [44, 5], [44, 0], [64, 0], [36, 10], [22, 10]]


def write(folder, document: dict | str) -> None:
    text = document if isinstance(document, str) else yaml.safe_dump(document)
    (folder / "diagnosis.yaml").write_text(text)


def model_and_options(folder, config: Config | None = None):
    case = diagnosis_case(load_case(folder, config or Config()))
    model = case.model(RunStore(None, threads=1))
    return case, model, case.options(model)


def test_the_defaults(embankment):
    (embankment / "diagnosis.yaml").unlink()
    case, model, options = model_and_options(embankment)
    assert case.scene.spacing == 1.0
    assert options.hold_out is None and not options.synthetic and options.effects is None
    assert options.allowance == 1398 and options.replicates == 8
    names = [candidate.name for candidate in model.candidates]
    assert {"overburden_strength", "weak_base", "datum_shift", "datum_tilt"} <= set(names)
    assert "there is no water" in case.left_out(model)["pore_pressure"]
    assert all(role == "fitted" for role in model.targets.roles)


def test_what_an_engineer_knows_reaches_the_statistics(embankment):
    write(embankment, {
        "forbid": {"shaking": "there was no earthquake", "pore_pressure": "it is dry"},
        "effects": ["weak_base", "overburden_strength", "water_drag"],
        "priors": {"weak_base": {"mean": 0.3, "std": 0.1}, "pool_level": {"mean": 0, "std": 1}},
        "parameters": {"strain_softening": {"reference_strain": 0.5}},
        "hold_out": {"groups": ["toe"], "blocks": {"surface": [10.0, 25.0]}},
        "spacing_m": 2.0, "duration_s": 30.0, "replicates": 4,
        "second_scheme": False,
        "finer_share": 0.0, "finer_share_std": 0.25, "synthetic": True,
    })  # fmt: skip
    case, model, options = model_and_options(embankment)
    # Effects that cannot act here are not put to the statistics, which know of none.
    assert options.forbidden == ("shaking",)
    assert options.effects == ("weak_base", "overburden_strength")
    assert options.priors == {"weak_base": (0.3, 0.1)}
    (candidate,) = [one for one in model.candidates if one.name == "weak_base"]
    assert (candidate.prior_mean, candidate.prior_std) == (0.3, 0.1)
    assert options.hold_out == HoldOut(("toe",), {"surface": (10.0, 25.0)})
    assert (options.replicates, options.second_scheme) == (4, False)
    assert (options.finer_share, options.finer_share_std) == (0.0, 0.25)
    assert options.synthetic
    assert case.scene.spacing == 2.0 and case.setup.settings.duration_s == 30.0
    assert model.numbers == {"strain_softening": {"reference_strain": 0.5}}
    left_out = case.left_out(model)
    assert left_out["shaking"] == "ruled out by the engineer: there was no earthquake"
    assert left_out["pore_pressure"] == "ruled out by the engineer: it is dry"


def test_a_list_of_vetoes_has_no_reasons(embankment):
    write(embankment, {"forbid": ["shaking"], "hold_out": "automatic"})
    case, model, options = model_and_options(embankment)
    assert options.forbidden == ("shaking",)
    assert case.left_out(model)["shaking"] == "ruled out by the engineer"


def test_what_the_case_holds_out_replaces_the_flags_of_the_survey(embankment):
    path = embankment / "measurements.yaml"
    path.write_text(
        path.read_text().replace("type: toe_runout,", "type: toe_runout, held_out: true,")
    )
    roles = dict(zip(*[getattr(diagnosis_case(load_case(embankment)).setup.targets, name)
                       for name in ("names", "roles")], strict=True))  # fmt: skip
    assert roles["toe"] == "held out"
    write(embankment, {"hold_out": {"groups": []}})
    targets = diagnosis_case(load_case(embankment)).setup.targets
    assert set(targets.roles) == {"fitted"}


def test_spacing_of_the_command_of_the_case_and_of_the_configuration(embankment):
    config = load_config(None, ["diagnosis.spacing_factor=2"])
    assert diagnosis_case(load_case(embankment, config)).scene.spacing == 2.0
    assert diagnosis_case(load_case(embankment, config), spacing_m=1.5).scene.spacing == 1.5
    write(embankment, {"spacing_m": 1.25})
    assert diagnosis_case(load_case(embankment)).scene.spacing == 1.25


def test_constructed_data_enter_nothing(root):
    case = diagnosis_case(
        load_case(root / "case_histories" / "lower_san_fernando_paper"), spacing_m=4
    )
    roles = dict(zip(case.setup.targets.names, case.setup.targets.roles, strict=True))
    assert roles["upstream toe"] == "fitted"
    assert {role for name, role in roles.items() if name.startswith("profile")} == {"constructed"}


@pytest.mark.parametrize(
    ("document", "complaint"),
    [
        ("[1, 2]", "must be a mapping of keys, not list"),
        ({"forbidden": ["shaking"]}, "forbidden: unknown key; the keys are listed in docs/meth"),
        ({"forbid": ["shakign"]}, "forbid: no effect 'shakign'; there are boundary|cracking"),
        ({"effects": ["gravity"]}, "effects: no effect 'gravity'"),
        ({"effects": []}, "effects: List should have at least 1 item"),
        ({"effects": ["shaking"], "forbid": ["shaking"]}, "'shaking' is also under forbid"),
        ({"priors": {"weak_base": {"mean": 0.3, "std": 0}}}, "std: Input should be greater than 0"),
        ({"priors": {"mud": {"mean": 0.3, "std": 1}}}, "priors: no effect 'mud'"),
        ({"parameters": {"shaking": {"colour": 1.0}}}, "'colour' is unknown; known are"),
        ({"parameters": {"mud": {"colour": 1.0}}}, "parameters: no effect 'mud'"),
        ({"parameters": {"strain_softening": {"reference_strain": 1e9}}}, "allowed are 0.001 to"),
        ({"hold_out": {"groups": ["tow"]}}, "hold_out: no measurement 'tow'; there are marker 1"),
        ({"hold_out": {"blocks": {"surface": [3.0, 1.0]}}}, "from 3 to 1 must ascend"),
        ({"hold_out": {"blocks": {"surface": [90.0, 99.0]}}}, "no number between 90 and 99"),
        ({"hold_out": "everything"}, "hold_out"),
        ({"spacing_m": -1.0}, "spacing_m: Input should be greater than 0"),
        ({"validation_case": "../nowhere"}, "validation_case: .*nowhere: no such folder; a"),
        ({"validation_case": "."}, "validation_case: .: is this case; name another one"),
    ],
)  # fmt: skip
def test_what_is_refused(embankment, document, complaint):
    write(embankment, document)
    with pytest.raises(InputError, match=complaint) as caught:
        model_and_options(embankment)
    assert str(caught.value).startswith(str(embankment / "diagnosis.yaml"))
    assert "\n" not in str(caught.value)


def test_the_case_that_judges_the_answer_is_read_at_once(embankment, tmp_path):
    """It is simulated after the whole loop; whatever is wrong with it is reported before."""
    other = tmp_path / "other"
    shutil.copytree(embankment, other)
    write(other, {"validation_case": "../embankment"})  # each may judge the other
    for name in ("../other", str(other)):
        write(embankment, {"validation_case": name})
        case = diagnosis_case(load_case(embankment))
        assert case.validation_case.name == "other" and case.validation_case.validation_case is None
    write(other, {"effects": ["gravity"]})
    with pytest.raises(
        InputError, match="validation_case: .*other.*: effects: no effect 'gravity'"
    ):
        diagnosis_case(load_case(embankment))


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"zones": {"sand": {"name": "silt"}}}, "01_x.yaml: scene_changes: zones: 'sand' is gone"),
        ({"effects": {"magic": 1.0}}, "01_x.yaml: effect 'magic' is unknown"),
        ({"zones": {"fill": {"polygon": LOWER}}}, "01_x.yaml: .*'marker 3': the marker .* no zone"),
    ],
)
def test_a_model_that_does_not_fit_the_case(embankment, changes, complaint):
    model = Hypothesis(scene_changes=changes)
    with pytest.raises(InputError, match=complaint):
        diagnosis_case(load_case(embankment), hypothesis=model, hypothesis_source="01_x.yaml")


def test_a_folder_that_is_none(tmp_path):
    with pytest.raises(InputError, match="no such folder; a case has scene.yaml, and measurements"):
        diagnosis_case(load_case(tmp_path / "nowhere"))


def test_older_keys_are_read_and_a_line_says_what_to_write(embankment, capsys):
    other = embankment.parent / "other"
    shutil.copytree(embankment, other)
    write(embankment, {"transfer": False, "transfer_check": "../other"})
    case = diagnosis_case(load_case(embankment))
    assert case.question.second_scheme is False and case.validation_case.name == "other"
    path = embankment / "diagnosis.yaml"
    assert capsys.readouterr().err.splitlines() == [
        f"{path}: transfer: is called second_scheme now",
        f"{path}: transfer_check: is called validation_case now",
    ]


@pytest.mark.slow
def test_the_error_of_a_code_that_made_the_slide_is_a_part_of_its_own(embankment):
    """It enlarges C by what is stated, correlated along the profile, and is named on the page."""
    write(embankment, {"source": {"surface_profile": {"std": 0.7, "correlation_length": 20.0},
                                  "toe_runout": {"std": 2.0}}})  # fmt: skip
    case, model, options = model_and_options(embankment)
    plain = replace(options, source={})
    off = {"numerical_covariance": False}
    base = calibrate(model, replace(options, **off))
    without = calibrate(model, replace(plain, **off))
    added = base.covariance.total - without.covariance.total
    toe = next(n for n, one in enumerate(model.targets.names) if "toe" in one)
    assert added[toe, toe] == pytest.approx(4.0)
    assert np.count_nonzero(added[toe]) == 1
    assert np.array_equal(base.covariance.survey, without.covariance.survey)  # no bound is loosened
    assert "the code that made the slide" in fitted_to_part(base, model.targets).covariance
    assert "the code that made the slide" not in fitted_to_part(without, model.targets).covariance


@pytest.mark.slow
def test_the_strength_that_another_code_would_find_makes_ours_less_certain(embankment):
    """As a share in quadrature: its variance is added to that of ln S_r, and to nothing else."""
    write(embankment, {"source_strength": 0.05})
    _, model, options = model_and_options(embankment)
    off = {"numerical_covariance": False}
    base = calibrate(model, replace(options, **off))
    without = calibrate(model, replace(options, source_strength=0.0, **off))
    assert np.array_equal(base.covariance.total, without.covariance.total)
    assert np.array_equal(base.fit.x, without.fit.x)

    def variance(one):
        fit = one.fit
        return system(one.data, fit.space, fit.derivative, fit.x).spread_with(None) ** 2

    # Of x, the logarithm in prior standard deviations, which follow from the bounds.
    added = (variance(base) - variance(without)) * base.fit.space.parameters.prior_std**2
    assert added == pytest.approx([0.0025, 0.0])


def test_the_error_of_a_code_is_refused_for_what_nobody_measures(embankment):
    write(embankment, {"source": {"seismogram": {"std": 1.0}}})
    with pytest.raises(InputError, match="no measurement type 'seismogram'"):
        diagnosis_case(load_case(embankment, Config()))


def _only(folder, *wanted) -> None:
    """Keep these measurements alone: a name, or a name and True: held out."""
    path = folder / "measurements.yaml"
    document = yaml.safe_load(path.read_text())
    (name,) = document["sets"]
    known = {entry["name"]: entry for entry in document["sets"][name]}
    document["sets"][name] = [{**known[one], "held_out": held} for one, held in wanted]
    path.write_text(yaml.safe_dump(document))


def test_a_question_that_leaves_nothing_to_test_is_refused(embankment):
    _only(embankment, ("toe", False))
    path = embankment / "inversion.yaml"
    question = yaml.safe_load(path.read_text())
    for parameter in question["parameters"]:
        parameter.pop("prior", None)
    path.write_text(yaml.safe_dump(question))
    with pytest.raises(InputError, match="measured numbers: 1, unknowns: 2; nothing is left"):
        model_and_options(embankment)


def test_as_many_numbers_as_unknowns_are_a_question(embankment):
    # La Marquesa: two toes and a crest, three strengths. Bounds of the strengths are known as well.
    _only(embankment, ("toe", False), ("marker 1", False))
    model_and_options(embankment)


@pytest.mark.slow
@pytest.mark.parametrize("others", [[("marker 1", True)], []], ids=["held out", "a prior alone"])
def test_a_fit_without_freedom_is_judged_by_what_else_is_known(embankment, others):
    _only(embankment, ("toe", False), *others)
    _, model, options = model_and_options(embankment)
    found = compare(model, options)
    assert found.adequacy.dof <= 0 and np.isfinite(found.adequacy.p_combined)
    assert [test.p for test in found.adequacy.tests if test.name == "chi2"] == [1.0]
