"""A result whose parts do not fit together is reported in one line, before anything is drawn."""

from __future__ import annotations

import json

import pytest

from inversion.back_analysis.result import load_result
from inversion.back_analysis.result_files import classical_beside
from pipeline.cli import InputError
from tests.inversion import report_case


@pytest.fixture(scope="module")
def whole():
    return report_case.full().model_dump(mode="json")


@pytest.mark.parametrize(
    ("place", "value", "complaint"),
    [
        ("answer.parameters", [], "answer.parameters: is empty"),
        ("iterations", [], "iterations: is empty"),
        ("measurements", [], "measurements: is empty"),
        ("sensitivities.0.sides", [], "sensitivities.0.sides: is empty"),
        ("answer.undetermined.0.direction", {}, "answer.undetermined.0.direction: is empty"),
        ("answer.parameters.0.name", "other", "other is not a parameter of the question"),
        ("iterations.0.values", {}, "iterations.0.values: residual_strength_1 is missing"),
        ("starts.1.answer", {}, "starts.1.answer: residual_strength_1 is missing"),
        ("variants.0.values", {}, "variants.0.values: residual_strength_1 is missing"),
        ("noise.answer_std", {}, "noise.answer_std: residual_strength_1 is missing"),
        ("answer.correlation.matrix", [[1.0]], "answer.correlation: must be 2 by 2"),
        ("engine", "fem", "engine: 'fem'; allowed are mpm, gns, mpm3d, direct"),
        ("classical.0", {}, "classical.0: needs a name and a list of methods"),
        ("classical.0.methods.0.low_kpa", None, "the lower and the upper end: give both or"),
        ("classical.0.methods.0.value_kpa", "much", "numbers or null are wanted, in kPa"),
        ("published.olson_stark_2002.value", "18", "published.olson_stark_2002: numbers or null"),
    ],
)
def test_a_result_in_parts(whole, tmp_path, place, value, complaint):
    document = json.loads(json.dumps(whole))
    *way, last = [int(key) if key.isdigit() else key for key in place.split(".")]
    part = document
    for key in way:
        part = part[key]
    part[last] = value
    path = tmp_path / "result.json"
    path.write_text(json.dumps(document))
    with pytest.raises(InputError) as caught:
        load_result(tmp_path)
    assert str(caught.value).startswith(f"{path}: ") and complaint in str(caught.value)
    assert "\n" not in str(caught.value)


def test_classical_methods_next_to_that_are_none(tmp_path):
    path = tmp_path / "classical" / "classical.json"
    path.parent.mkdir()
    path.write_text('{"analyses": [{"name": "upstream", "methods": [{"title": "ZIF"}]}]}')
    with pytest.raises(InputError, match="classical.json: .*methods.0.value_kpa: is missing"):
        classical_beside(tmp_path / "inversion")
