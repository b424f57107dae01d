"""The catalogue, the correlations at points computed by hand, and the picture."""

from __future__ import annotations

import json
import shutil

import numpy as np
import pytest

from flowslide.command_line import main
from geometry.scenes.scene import load_scene
from inversion.catalogue.catalogue import (
    FOLDER,
    OurAnswer,
    answers_of,
    blow_count,
    load_answers,
    load_catalogue,
    load_strengths,
)
from inversion.catalogue.correlations import (
    RELATIONS,
    idriss_boulanger_2008,
    kramer_wang_2015,
    olson_stark_2002,
    weber_2015,
)
from pipeline.cli import InputError
from report.charts.catalogue import catalogue_figure, draw_catalogue

ZONES = tuple(f"upstream_fill_{k}" for k in range(1, 5))
OURS = OurAnswer("lower_san_fernando", "Lower San Fernando", "S_r", ZONES, 27.5, 3.0, 0.17, 0.02)


def case_strengths(case: str) -> list:
    """The strengths that others found for a case folder."""
    names = {entry.name for entry in load_catalogue() if entry.case == case}
    return [strength for strength in load_strengths() if strength.name in names]


def parameter(**fields) -> dict:
    return {"label": "S_r", "zones": list(ZONES), "value": 27.5, "std_total": 3.0, "ratio": 0.17,
            "ratio_std": 0.02, **fields}  # fmt: skip


def result(*parameters: dict) -> dict:
    return {
        "case": "lower_san_fernando",
        "title": "Lower San Fernando",
        "answer": {"parameters": list(parameters)},
    }


# --- correlations ---


def test_olson_and_stark_by_hand():
    # 0.03 + 0.0075 x 0, x 8, x 12
    assert olson_stark_2002(np.array([0.0, 8.0, 12.0])) == pytest.approx([0.03, 0.09, 0.12])
    assert np.isnan(olson_stark_2002(12.1)) and np.isnan(olson_stark_2002(-1.0))


def test_idriss_and_boulanger_by_hand():
    # N = 16: exp(1 - 3) = e^-2. N = 0: (16/21.2)^3 = 0.429887, so exp(-3.429887).
    assert idriss_boulanger_2008(16.0) == pytest.approx(0.1353353)
    assert idriss_boulanger_2008(0.0) == pytest.approx(np.exp(-3.429887), rel=1e-5)
    assert idriss_boulanger_2008(60.0) == pytest.approx(np.tan(np.radians(33.0)))
    assert idriss_boulanger_2008(60.0, friction_deg=45.0) == pytest.approx(1.0)


def test_kramer_and_wang_by_hand():
    # At one atmosphere: exp(-8.444 + 1.09 + 5.379) = exp(-1.975) = 0.138761 atm = 14.060 kPa.
    assert kramer_wang_2015(10.0, 101.325) == pytest.approx(14.060, abs=0.001)
    # At two: 2^0.1 = 1.0717735, so exp(-8.444 + 5.765070) = exp(-2.678930) at N = 0.
    assert kramer_wang_2015(0.0, 202.65) == pytest.approx(101.325 * np.exp(-2.678930), rel=1e-5)
    assert kramer_wang_2015(np.array([0.0, 10.0]), 100.0).shape == (2,)


def test_the_relations_at_lower_san_fernando_are_the_published_ones():
    """N 12.9 and 145 kPa: values that come with the published models of the dam [kPa]."""
    expected = {
        "idriss_boulanger_2008": 16.1, "olson_stark_2002": 17.4, "weber_2015": 22.8,
        "kramer_wang_2015": 23.5,
    }  # fmt: skip
    found = {name: RELATIONS[name].strength(12.9, 145.0) for name in expected}
    assert found == pytest.approx(expected, abs=0.05)
    # Voids that cannot redistribute: times 1 + exp(12.9 / 2.4 - 6.6) = 1.293756.
    other = RELATIONS["idriss_boulanger_2008_no_redistribution"].strength(12.9, 145.0)
    assert other / found["idriss_boulanger_2008"] == pytest.approx(1.293756, rel=1e-5)


def test_caps_of_the_relations():
    assert RELATIONS["olson_stark_2002"].strength(30.0, 100.0) == pytest.approx(12.0)
    assert RELATIONS["olson_stark_2002"].beyond(12.1)
    assert not RELATIONS["olson_stark_2002"].beyond(12.0)
    kramer = RELATIONS["kramer_wang_2015"]
    assert kramer.strength(30.0, 100.0) == kramer.strength(15.0, 100.0) and kramer.beyond(15.1)
    assert RELATIONS["weber_2015"].strength(30.0, 100.0) == pytest.approx(29.0)
    for form in ("idriss_boulanger_2008", "idriss_boulanger_2008_no_redistribution"):
        assert RELATIONS[form].strength(60.0, 100.0) == pytest.approx(64.94, abs=0.01)


def test_weber_by_hand():
    # At one atmosphere and N = 10: exp(1.407 + 4.2399) = 283.41; 10^1.45 + 2 + 41.13 = 71.3138.
    expected = 0.048 * (283.41 - 0.43991 * 71.3138)
    assert weber_2015(10.0, 101.325) == pytest.approx(expected, rel=1e-4)
    assert np.all(weber_2015(np.linspace(0.0, 60.0, 50), 1.0) >= 0.0)


@pytest.mark.parametrize("name", RELATIONS)
def test_strength_rises_with_blow_count_and_stress_and_scatters(name):
    relation = RELATIONS[name]
    by_count = [relation.strength(n, 120.0) for n in np.linspace(1.0, 12.0, 12)]
    by_stress = [relation.strength(8.0, s) for s in np.linspace(20.0, 300.0, 12)]
    assert np.all(np.diff(by_count) > 0.0) and np.all(np.diff(by_stress) > 0.0)
    if relation.band is None:
        assert relation.log_std(8.0, 120.0) == 0.4 and "assumed" in relation.scatter_words
    else:  # Olson and Stark: 0.03 of 0.09
        assert relation.log_std(8.0, 120.0) == pytest.approx(1.0 / 3.0)


# --- files ---


def test_the_sixteen_cases():
    entries = {entry.name: entry for entry in load_catalogue()}
    assert len(entries) == 16
    assert {entry.template for entry in entries.values()} == {"a", "b", "c"}
    dam = entries["Lower San Fernando Dam"]
    assert (dam.height_m, dam.paper_height_m, dam.case) == (43.3, 53.0, "lower_san_fernando")
    changed = [e for e in entries.values() if e.height_m != e.paper_height_m]
    assert changed == [dam] and "142 ft" in dam.note
    for entry in entries.values():
        assert not entry.case or (FOLDER / entry.case / "scene.yaml").is_file()


def test_strengths_say_how_far_they_may_be_trusted():
    strengths = load_strengths()
    assert all(s.confidence for s in strengths)
    assert all(bool(s.soil_confidence) == (s.n1_60 is not None) for s in strengths)
    (ours,) = [s for s in case_strengths("lower_san_fernando") if s.source.startswith("Olson")]
    assert (ours.s_r_kpa, ours.low_kpa, ours.high_kpa) == (18.7, 15.8, 21.8)
    assert ours.ratio == pytest.approx(18.7 / 166.7) and ours.recalled
    assert ours.ratio_range == pytest.approx((15.8 / 166.7, 21.8 / 166.7))
    assert len(case_strengths("la_marquesa")) == 8 and case_strengths("my_dam") == []


def test_the_strengths_in_the_case_folders_are_the_same():
    from geometry.survey.measurements import load_measurements

    for case in ("lower_san_fernando", "la_marquesa"):
        beside = load_measurements(FOLDER / case).strength_published_kpa.values()
        there = [(s.s_r_kpa, s.low_kpa, s.confidence) for s in case_strengths(case)]
        assert sorted(
            (b["value"], b.get("low"), b["confidence"]) for b in beside if "low" in b
        ) == (sorted(t for t in there if t[1] is not None))
        assert sorted(b["value"] for b in beside) == sorted(t[0] for t in there)


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ("18.7,15.8", "38.7,15.8", "s_r_kpa 38.7 lies outside low_kpa 15.8 to high_kpa 21.8"),
        ("18.7,15.8", "18.7,", "low_kpa, high_kpa: give both or neither"),
        ("18.7,15.8", "much,15.8", "line 7: s_r_kpa: 'much' is not a number greater than 0"),
        ("18.7,15.8", "-1,15.8", "'-1' is not a number greater than 0"),
        ("11.5,published", "11.5,certain", "confidence: 'certain'; allowed are published, paper"),
        ("Fort Peck Dam", "Fort Apache", "name: 'Fort Apache' is not in catalogue.csv"),
        ("s_r_kpa,", "strength,", "column s_r_kpa is missing"),
    ],
)
def test_strengths_that_do_not_hold_together(tmp_path, old, new, complaint):
    for name in ("catalogue.csv", "catalogue_strengths.csv"):
        shutil.copy(FOLDER / name, tmp_path)
    path = tmp_path / "catalogue_strengths.csv"
    lines = path.read_text().splitlines(keepends=True)
    text = "".join(line if line.startswith("#") else line.replace(old, new) for line in lines)
    assert text != path.read_text()
    path.write_text(text)
    with pytest.raises(InputError, match=complaint):
        load_strengths(tmp_path)


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        (b"\x89PNG\r\n\x1a\n\xff\x00", "not a UTF-8 text file"),
        ("case;höhe".encode("latin-1"), "not a UTF-8 text file"),
        (b"", "column name is missing"),
    ],
)
@pytest.mark.parametrize("name", ["catalogue.csv", "catalogue_strengths.csv"])
def test_tables_that_are_none(tmp_path, name, content, complaint):
    for one in ("catalogue.csv", "catalogue_strengths.csv"):
        shutil.copy(FOLDER / one, tmp_path)
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=f"{name}: {complaint}"):
        load_strengths(tmp_path)


def test_a_row_that_is_too_long_or_goes_on(tmp_path):
    text = (FOLDER / "catalogue.csv").read_text()
    for more, complaint in ((",1,2", "has more cells than"), (',"', "goes over several lines")):
        (tmp_path / "catalogue.csv").write_text(text.rstrip() + f"{more}\n{'x' * bool(more)}\n")
        with pytest.raises(InputError, match=complaint):
            load_catalogue(tmp_path)


# --- our answers ---


def test_zones_of_the_catalogue_are_those_of_its_cases(root):
    cases = {entry.name: entry.case for entry in load_catalogue() if entry.case}
    for strength in load_strengths():
        if strength.zones:
            scene = load_scene(root / "case_histories" / cases[strength.name] / "scene.yaml")
            assert set(strength.zones) <= {zone.name for zone in scene.zones}, strength.name


def test_our_answers_stand_over_the_blow_count_of_their_zone():
    strengths, entries = load_strengths(), load_catalogue()
    assert blow_count(OURS, strengths, entries).n1_60 == 11.5

    def marquesa(*zones):
        return OurAnswer("la_marquesa", "La Marquesa", "S_r", zones, 3.0, 1.0, 0.1, 0.03)

    assert blow_count(marquesa("6"), strengths, entries).n1_60 == 4.5
    assert blow_count(marquesa("2"), strengths, entries).n1_60 == 9
    assert blow_count(marquesa("9"), strengths, entries) is None
    own = OurAnswer("my_dam", "My Dam", "S_r", ("1",), 3.0, 1.0, 0.1, 0.03)
    assert blow_count(own, strengths, entries) is None


def test_answers_are_read_from_results(tmp_path):
    friction = parameter(label="phi", ratio=None)
    assert answers_of(result(parameter(), friction)) == [OURS]
    path = tmp_path / "result.json"
    path.write_text(json.dumps(result(parameter())))
    assert load_answers([path, path]) == [OURS, OURS]
    path.write_text('{"case": "x"}')
    with pytest.raises(InputError, match="is not an answer of a back-analysis"):
        load_answers([path])


# --- the picture ---


def test_the_picture_shows_all_that_has_a_place():
    own = OurAnswer("my_dam", "My Dam", "S_r", ("base",), 10.0, 2.0, 0.7, 0.1)
    figure = catalogue_figure(load_catalogue(), load_strengths(), [OURS, own])
    (ax,) = figure.axes
    words = [text.get_text() for text in ax.texts]
    assert f"A  Lower San Fernando, zones {', '.join(ZONES)}: 27.5 ± 3 kPa" in words
    assert "B  My Dam, zone base: 10 ± 2 kPa" in words and "blow count\nunknown" in words
    placed = [s for s in load_strengths() if s.ratio is not None and s.n1_60 is not None]
    assert len(placed) == 10
    hollow = [line for line in ax.lines if line.get_markerfacecolor() == "white"]
    assert len(hollow) == sum(s.recalled for s in placed) == 10
    assert ax.get_ylim()[1] > 0.8
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert all(any(text.startswith(one.label) for text in labels) for one in RELATIONS.values())
    assert any("partly recalled" in text for text in labels)
    assert any("our back-analysis" in text for text in labels)


def test_the_command_prints_and_draws(tmp_path, capsys):
    path = tmp_path / "results" / "lower_san_fernando" / "inversion" / "result.json"
    path.parent.mkdir(parents=True)
    path.write_text(json.dumps(result(parameter())))
    picture = tmp_path / "c.svg"
    main(["catalogue", "--results", str(tmp_path / "results"), "--out", str(picture)])
    out = capsys.readouterr().out
    assert "our answer: Lower San Fernando, S_r: 27.5 +- 3 kPa, ratio 0.170 +- 0.020" in out
    assert "Chonan Middle School" in out and "stress and blow count recalled" in out
    assert picture.read_text().startswith("<?xml")
    with pytest.raises(InputError, match="allowed are"):
        draw_catalogue(tmp_path / "c.txt")
    with pytest.raises(InputError, match="is a folder; give the name of a picture"):
        main(["catalogue", "--out", str(tmp_path)])
    capsys.readouterr()
    with pytest.raises(InputError, match="--results .*nowhere: no such folder"):
        main(["catalogue", "--results", str(tmp_path / "nowhere")])
    assert capsys.readouterr().out == ""


def test_a_picture_that_cannot_be_written_is_refused_before_the_table(capsys):
    with pytest.raises(InputError, match="suffix '.abc'; allowed are"):
        main(["catalogue", "--out", "picture.abc"])
    assert capsys.readouterr().out == ""
