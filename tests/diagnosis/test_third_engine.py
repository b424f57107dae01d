"""A third engine is two files: back-analysis, prediction and diagnosis find it by its name."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import flowslide
from diagnosis.case import diagnosis_case
from diagnosis.diagnose import diagnose
from diagnosis.hypotheses.model import Model
from diagnosis.options import Options
from diagnosis.verdict.verdict_builder import verdict_document
from docs.examples.my_engine import FORMULA, FormulaEngine
from flowslide.command_line import main
from geometry.case import load_case
from inversion.back_analysis.by_engine import back_analysis_by, chosen_engine
from inversion.back_analysis.case import inversion_case
from inversion.back_analysis.result import Result
from inversion.back_analysis.result_files import side_by_side
from inversion.engines import registry
from inversion.engines.run_store import RunStore
from inversion.estimation.forward import Forward
from inversion.posterior.runs import CaseModel
from inversion.posterior.varied_case import varied_case
from inversion.prediction.known_strength import KnownStrength
from inversion.prediction.predict import predict
from pipeline.cli import InputError
from pipeline.config import load_config
from pipeline.files import read_json
from pipeline.progress import Watch
from report.back_analysis import summary
from report.data.back_analysis import BackAnalysisData

TRUTH, HIDDEN = 12.0, 0.4


@pytest.fixture
def formula(monkeypatch):
    monkeypatch.setattr(registry, "_engines", dict(registry.engines()))
    return registry.register_engine(FORMULA)


def surveyed(setup, hidden: float = 0.0):
    """The setup with measurements that the formula itself has made."""
    scene = setup.scene.model_copy(update={"effects": {"weak_base": hidden} if hidden else {}})
    made = FormulaEngine(RunStore(None))
    values = setup.parameters.start.copy()
    values[0] = TRUTH
    (told,) = made.predict([replace(setup, scene=scene).at(values)])
    return replace(setup, targets=replace(setup.targets, measured=told.values))


def test_it_is_an_engine_and_an_unknown_one_is_refused(embankment, formula):
    case = inversion_case(load_case(embankment))
    assert isinstance(FormulaEngine(RunStore(None)), Forward)
    assert chosen_engine(case, "formula", None).engine is formula
    with pytest.raises(
        InputError, match="no engine 'fem'; there are mpm, gns, mpm3d, direct, formula"
    ):
        chosen_engine(case, "fem", None)
    with pytest.raises(InputError, match="goes with --engine gns; the engine is formula"):
        chosen_engine(case, "formula", "coarse")


def test_the_back_analysis_finds_the_strength(embankment, formula, tmp_path):
    case = inversion_case(load_case(embankment))
    case = replace(case, setup=surveyed(case.setup))
    store = RunStore(None)
    result = back_analysis_by(formula, case, store, Watch()).run()
    assert result.engine == "formula" and store.computed == 0
    assert result.answer.reached
    assert result.answer.parameters[0].value == pytest.approx(TRUTH, rel=0.02)
    assert "back-analysis by formula at" in summary(BackAnalysisData(tmp_path, result))
    assert Result.model_validate_json(result.model_dump_json()) == result
    assert side_by_side(result, tmp_path / formula.folder) == []


def test_a_prediction_asks_it(embankment, formula):
    case = inversion_case(load_case(embankment))
    engine = formula.forward(RunStore(None))
    fixed = case.setup.parameters.start[1:]
    known = [KnownStrength(("1",), TRUTH, 1.0, "lognormal")]
    known += [KnownStrength(("2",), float(value), 0.01 * value, "normal") for value in fixed]
    found = predict(engine, case.setup, known, samples=500)
    assert found.failed == 0
    assert np.median(found.samples[:, 0]) == pytest.approx(30.0 - 5.0 * np.log(TRUTH), abs=0.1)


def test_the_diagnosis_finds_the_hidden_effect(embankment, formula):
    case = diagnosis_case(load_case(embankment), spacing_m=2.0)
    case = replace(case, setup=surveyed(case.setup, HIDDEN))
    model = case.model(RunStore(None), formula)
    assert isinstance(model, Model) and model.curves == []
    options = replace(case.options(model), draws=2000)
    assert isinstance(options, Options)
    verdict = verdict_document(diagnose(model, options), case=case.name, title=case.title)
    assert verdict.verdict == "identified"
    (effect,) = verdict.answer.effects
    assert effect.name == "weak_base" and effect.amplitude == pytest.approx(HIDDEN, abs=0.1)
    assert verdict.final.values[model.parameters.names[0]] == pytest.approx(TRUTH, rel=0.05)
    assert model.computed == 0 and not model.failures


@pytest.mark.slow
def test_every_function_of_the_interface_asks_it(embankment, formula, tmp_path):
    predicted = flowslide.predict(embankment, ["12+-2"], engine="formula", seeds=2, samples=500)
    middle = predicted["quantities"][0]["mean"]
    assert middle == pytest.approx(30.0 - 5.0 * np.log(TRUTH), abs=0.3)
    few = {"replicates": 2, "draws": 200, "starts": 1, "rounds": 1, "refitted": 1, "max_runs": 70}
    settings = load_config(None, [f"diagnosis.{name}={value}" for name, value in few.items()])
    verdict = flowslide.diagnose(
        embankment, engine="formula", out=tmp_path / "diagnosis", settings=settings
    )
    assert verdict.manifest["settings"]["engine"] == "formula"
    assert not (tmp_path / "diagnosis" / "sections.npz").exists()
    section = varied_case(inversion_case(load_case(embankment)))
    model, start = CaseModel(section, RunStore(None), formula), section.case.parameters.start
    (row,) = model.run(
        np.concatenate([start, np.zeros(len(section.nuisances))])[None], coarse=False
    )
    assert row[0] == pytest.approx(30.0 - 5.0 * np.log(start[0]))
    for ask in (flowslide.diagnose, flowslide.compare, flowslide.explain, flowslide.posterior):
        with pytest.raises(InputError, match="engine: gns .Diff-GNS. needs a trained model"):
            ask(embankment, engine="gns")


@pytest.mark.slow
def test_a_whole_back_analysis_is_written(embankment, formula, tmp_path):
    result = flowslide.back_analyse(
        embankment, engine="formula", out=tmp_path, quick=True, spacing_m=2.0, threads=1
    )
    assert result.engine == "formula"
    assert {path.name for path in tmp_path.iterdir()} >= {"result.json", "history.csv", "run.h5"}


def test_the_command_line_asks_the_engine_that_is_named(embankment, formula, tmp_path, capsys):
    out = tmp_path / "out"
    asked = ["diagnose", "compare", str(embankment), "--out", str(out), "--page", "no", "--quiet"]
    main([*asked, "--engine", "formula"])
    found = flowslide.compare(embankment, out=tmp_path / "python", engine="formula")
    assert read_json(out / "compare.json")["base"]["chi2"] == found.base.chi2
    with pytest.raises(InputError, match="answers back-analyses, posteriors and predictions"):
        main([*asked, "--engine", "mpm3d"])
