"""The reviewer's checklist: every row from the documents, and what nobody checked is named."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from diagnosis.verdict.verdict import save_document
from geometry.case import load_case
from inversion.problem.question import FixedProperty, Variant, WaterLevel
from report.data.back_analysis import BackAnalysisData
from report.data.diagnosis import DiagnosisData
from report.data.sources import Comments
from report.sentences.finding import headline
from report.tables.checklist import NOT_CHECKED, back_analysis_checklist, diagnosis_checklist
from report.tables.checklist import unchecked as unchecked_sentence
from tests.diagnosis.verdict_case import FORBIDDEN, ambiguous, identified
from tests.inversion.report_case import full, least

CASES = Path(__file__).resolve().parents[2] / "case_histories"
CORE, SHARED = "strength of the core", "the model lacks nothing"


def rows(table) -> dict[str, list]:
    """What was assumed -> value, how, moves, from."""
    assert len({row[0] for row in table.rows}) == len(table.rows)
    return {row[0]: list(row[1:]) for row in table.rows}


def data(folder, result, case=None) -> BackAnalysisData:
    made = folder / "inversion"
    made.mkdir(exist_ok=True)
    return BackAnalysisData(made, result, None, case)


def asked(result, **more):
    return result.model_copy(update={"question": result.question.model_copy(update=more)})


@pytest.mark.parametrize(
    ("way", "words"),
    [
        (("soils", "sand"), "a quarter: assumed"),
        (("soils", "clay"), "after the test of 1975 at # 3"),
        (("soils", "rock"), ""),
        (("level",), "read off the drawing, to the metre"),
        (("varied", "pool"), ""),
        (("varied", "pool", "kind"), "+-1 m"),
        (("varied", "no such"), ""),
        (("no such", "sand"), ""),
    ],
)
def test_a_comment_is_that_of_its_entry(tmp_path, way, words):
    path = tmp_path / "scene.yaml"
    path.write_text(
        "# a heading\n\nsoils:\n  sand: {c: 1}  # a quarter: assumed\n"
        "  # after the test\n  # of 1975 at # 3\n  clay: {c: 2,\n    d: 3}\n"
        "  rock: {name: 'no # comment'}\n"
        "# read off the drawing,\n# to the metre\nlevel: 3.0\nvaried:\n"
        "  - name: pool\n    kind: level   # +-1 m\n"
    )
    assert Comments(path).on(*way) == words


def test_a_file_that_is_missing_says_nothing(tmp_path):
    assert Comments(tmp_path / "none.yaml").on("materials", "core") == ""


def test_measurements_have_their_source_and_sensitivities_their_size(tmp_path):
    result = full()
    table = back_analysis_checklist(data(tmp_path, result))
    found = rows(table)
    assert "S_r" in table.caption and "kPa" in table.header[3]
    value, how, moves, source = found["upstream toe"]
    assert value == "53.0 m ± 5.8" and how.startswith("fitted") and source == "paper: the fill"
    assert "off by \N{MINUS SIGN}10.8 std" in found["freeboard"][1] and moves is None
    assert found["profile"][:2] == ["2 numbers", "constructed: takes no part"]
    (p,) = [p for p in result.answer.parameters if p.ratio is not None]
    assert found["errors of the survey, all together"][2] == f"± {p.std_data:.2f}"
    value, how, moves, _ = found["level of the fill"]
    assert moves == "± 0.80" and how == "varied by one std, linear estimate"
    assert "upper toe" not in found, "a target stands with its measurement"
    assert "2 jitter seeds" in found["place of the material points"][1]
    assert "2 first guesses" in found[p.label][1]
    assert unchecked_sentence(table) == f"Not checked: {SHARED}."
    poor = rows(back_analysis_checklist(data(tmp_path, least())))
    assert poor["place of the material points"][1] == NOT_CHECKED
    assert "one first guess alone" in poor["S_r of residual_strength_1"][1]


def test_what_the_section_assumes_is_varied_or_not_checked(tmp_path):
    case = load_case(CASES / "lower_san_fernando")
    found = rows(back_analysis_checklist(data(tmp_path, full(), case)))
    assert found[CORE][0] == "61 kPa" and found[CORE][1] == NOT_CHECKED
    assert "0.8 x 0.153" in found[CORE][3], "the comment in scene.yaml"
    assert found["phreatic line"][3].startswith("Constructed")
    assert found["water"][:2] == ["pool at 35.9 m", NOT_CHECKED]
    stated = case.drawn.materials["core"].model_copy(update={"source": "vane tests"})
    soils = {**case.drawn.materials, "core": stated}
    drawn = case.drawn.model_copy(update={"materials": soils})
    found = rows(back_analysis_checklist(data(tmp_path, full(), replace(case, drawn=drawn))))
    assert found[CORE][3] == "vane tests", "what the soil itself names goes before a comment"
    core = FixedProperty(name="c of the core", kind="property", zones=["core"],
                         property="cohesion_kpa", std=15.0)  # fmt: skip
    pool = WaterLevel(name="pool level", kind="water_level", std_m=0.5)
    dry, bonded = Variant(name="dry", water="none"), Variant(name="bonded", contact="no_slip")
    result = asked(full(), sensitivities=[core, pool], variants=[dry, bonded])
    found = rows(back_analysis_checklist(data(tmp_path, result, case)))
    assert found[CORE][1] == NOT_CHECKED, "a quick answer has asked for it, and answers it not"
    sensitivity, variant = result.sensitivities[0], result.variants[0]
    result = result.model_copy(update={
        "sensitivities": [sensitivity.model_copy(update={"name": "c of the core"})],
        "variants": [variant.model_copy(update={"name": name}) for name in ("dry", "bonded")],
    })  # fmt: skip
    table = back_analysis_checklist(data(tmp_path, result, case))
    found = rows(table)
    assert found[CORE][1] == "varied: c of the core"
    assert found["water"][1] == "varied: dry"
    assert found["contact with the base"][1] == "varied: bonded"
    assert found["pool level"][1].startswith(NOT_CHECKED), "it was asked for and has no answer"
    assert found["strength of the berm"][1] == NOT_CHECKED
    assert "strength of the berm" in unchecked_sentence(table)
    # A soil whose strength is sought is an unknown, and no assumption.
    strength = result.question.parameters[0]
    zones = [zone.name for zone in case.drawn.zones if zone.material == "berm"]
    strength = strength.model_copy(update={"zones": zones})
    result = asked(result, parameters=[strength, *result.question.parameters[1:]])
    assert "strength of the berm" not in rows(back_analysis_checklist(
        data(tmp_path, result, case)
    ))  # fmt: skip


def test_a_diagnosis_next_to_it_has_checked_the_model(tmp_path):
    verdict = identified().model_copy(update={"case": "no_such_case"})
    stiff = verdict.candidates[0].model_copy(update={"name": "stiffness_of_core", "family": "soil"})
    verdict = verdict.model_copy(update={"candidates": [*verdict.candidates, stiff]})
    (tmp_path / "diagnosis").mkdir()
    save_document(verdict, tmp_path / "diagnosis" / "verdict.json")
    case = load_case(CASES / "lower_san_fernando")
    found = rows(back_analysis_checklist(data(tmp_path, full(), case)))
    assert found[SHARED][1] == f"diagnosis, identified: {headline(verdict)}"
    assert found["stiffnesses (Young's modulus)"][1] == "diagnosis: 1 hypothesis tested"
    other = replace(data(tmp_path, full().model_copy(update={"case": "another"}), case))
    assert rows(back_analysis_checklist(other))[SHARED][1].startswith(NOT_CHECKED)


def test_a_diagnosis_lists_every_family_and_what_it_left_out(tmp_path):
    verdict = identified()
    table = diagnosis_checklist(DiagnosisData(tmp_path, verdict))
    found = rows(table)
    physics = found["without a physical effect"]
    assert "in the answer: strain softening" in physics[1]
    (p,) = [p for p in verdict.parameters if p.strength]
    tested = {c.name for c in verdict.candidates if c.family == "physics" and not c.left_out}
    hidden = verdict.hidden[p.name]
    worst = max((abs(v) for k, v in hidden.items() if k in tested))
    assert f"{worst:.0f} %" in physics[2]
    assert found[f"without {FORBIDDEN.replace('_', ' ')}"][1].startswith(f"{NOT_CHECKED}: ruled")
    assert found["another section or event"][1] == f"{NOT_CHECKED}: none was given"
    assert found["prediction of data that no fit has seen"][1].startswith("held out: chi²")
    assert "another section or event" in unchecked_sentence(table)
    two = rows(diagnosis_checklist(DiagnosisData(tmp_path, ambiguous())))
    assert two["without a physical effect"][1] != physics[1]


def test_of_a_body_nothing_is_said_of_a_section(tmp_path):
    settings = {"settings": {"engine": "mpm3d"}}
    verdict = identified().model_copy(update={"manifest": settings})
    table = diagnosis_checklist(DiagnosisData(tmp_path, verdict))
    assert "section" not in unchecked_sentence(table)
    assert {"without another shape of the body", "another event"} <= rows(table).keys()
    assert "without flanks that hold the slide back" not in rows(table)
    files = {row[-1] for row in table.rows}
    assert "measurements3d.yaml" in files and "measurements.yaml" not in files
