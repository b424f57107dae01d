"""Sets whose truths are other codes' slides: their plan, their survey errors, their score."""

from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import norm

from benchmarks.generated_pages import around
from benchmarks.hidden_effects.foreign.hidden import FAMILIES, THINGS, Hidden
from benchmarks.hidden_effects.foreign.slide import source
from benchmarks.hidden_effects.making import surveys
from benchmarks.hidden_effects.making.benchmark import Places, SourcePlan, load_benchmark
from benchmarks.hidden_effects.making.by_other_codes import plan_by_codes, survey_error
from benchmarks.hidden_effects.making.make import write_case
from benchmarks.hidden_effects.making.truth import Made
from benchmarks.hidden_effects.scoring.by_other_codes import ByCode, score_by_codes
from benchmarks.hidden_effects.scoring.digest import WindowDigest
from benchmarks.hidden_effects.scoring.page_by_codes import draw_all, generated
from benchmarks.hidden_effects.scoring.regions import regions
from benchmarks.hidden_effects.scoring.score import Judged
from benchmarks.studies.strength_by_verdict import (
    PAGE,
    Slide,
    beyond,
    by_other_codes,
    shown,
    slides_by_set,
    widened,
    worth,
)
from diagnosis.question import CodeError, load_diagnosis_question
from diagnosis.track_record import track_record
from pipeline.cli import InputError
from pipeline.files import read_yaml, yaml_text
from tests.hidden_effects.judges import digest

FOLDER = "benchmarks/hidden_effects"


@pytest.fixture(scope="module")
def benchmark():
    return load_benchmark(f"{FOLDER}/foreign.yaml")


@pytest.mark.slow
def test_plan_has_what_is_asked_for(benchmark):
    row = plan_by_codes(benchmark)
    assert Counter(one.kind for one in row) == {"null": 10, "single": 10, "outside": 4}
    assert Counter(one.source for one in row) == {"newton": 7, "smoothed_particles": 17}
    hidden = [THINGS[name] for one in row for name in one.effects if one.kind == "single"]
    assert {family for thing in hidden for family in thing.families} >= set(FAMILIES)
    for one in row:
        for name in one.effects:
            assert name in source(one.source).hides
            section = benchmark.sections_of(one.source)[one.section]
            assert not THINGS[name].applies(section.scene)
            assert THINGS[name].stranger == (one.kind == "outside")
    assert plan_by_codes(benchmark) == row
    grown = replace(benchmark, plan=benchmark.plan.model_copy(update={"cases": 96}))
    assert plan_by_codes(grown)[: len(row)] == row, "a set that grows keeps its cases"


def test_learning_set_has_other_cases(benchmark):
    learn = load_benchmark(f"{FOLDER}/foreign_learn.yaml")
    assert learn.plan.seed != benchmark.plan.seed
    assert 24 <= learn.plan.cases <= 32
    same = {**learn.plan.model_dump(), "seed": 0, "cases": 1}
    assert same == {**benchmark.plan.model_dump(), "seed": 0, "cases": 1}


@pytest.mark.parametrize("more", [{"things": ["drainng"]}, {"sizes": {"drainng": [(1.0, 2.0)]}}])
def test_a_thing_that_nobody_can_hide_is_refused(tmp_path, more):
    with pytest.raises(InputError, match=f"{next(iter(more))}: 'drainng': allowed are .*draining"):
        load_benchmark(_changed(tmp_path, "foreign_fifth", **more))


def _changed(folder, name, **changes):
    """A plan that ships, changed, where its sections are found."""
    plan = read_yaml(Path(f"{FOLDER}/{name}.yaml"))
    (folder / "sections").symlink_to(Path(f"{FOLDER}/sections").resolve())
    path = folder / "set.yaml"
    path.write_text(yaml_text({**plan, **changes}))
    return path


def test_codes_that_know_water_as_weight_alone_are_not_judged_by_its_pressure(tmp_path):
    with pytest.raises(InputError, match="weight alone, .* not so in reservoir_dam"):
        load_benchmark(_changed(tmp_path, "foreign_fifth", water="pore_pressure"))
    (tmp_path / "level").mkdir()
    dry = {"water": "pore_pressure", "sections": ["embankment"]}
    level = load_benchmark(_changed(tmp_path / "level", "foreign_fifth", **dry))
    assert level.plan.water == "pore_pressure" and level.plan.sources


def test_ground_is_as_the_plan_says(benchmark):
    sections = {code: benchmark.sections_of(code) for code in benchmark.plan.sources}
    contact = {
        code: {one.scene.ground.contact for one in own.values()} for code, own in sections.items()
    }
    assert contact == {"smoothed_particles": {"rough"}, "newton": {"no_slip"}}
    assert "reservoir_dam" in set(sections["smoothed_particles"]) - set(sections["newton"])
    truth = {"name": "case", "section": "embankment", "source": "newton"}
    assert benchmark.section(truth) == sections["newton"]["embankment"]
    assert benchmark.section({**truth, "source": ""}) == benchmark.sections["embankment"]


def test_errors_of_the_survey_move_elevations_alone(benchmark):
    section = benchmark.sections["embankment"]
    entries = surveys.entries_of(section, "history", 90.0)
    n = section.survey.profile.points
    shift = survey_error([Hidden("datum", 1.5)], entries)
    assert shift[:n] == pytest.approx(1.5)
    assert shift[n] == 0.0  # the toe
    tilt = survey_error([Hidden("tilt", 2.0)], entries)
    assert tilt[0] == pytest.approx(-2.0) and tilt[n - 1] == pytest.approx(2.0)
    assert np.all(np.diff(tilt[:n]) > 0.0)


def test_a_place_that_is_levelled_later_has_the_tilt_of_the_old_line(benchmark):
    section = benchmark.sections["embankment"]
    entries = surveys.entries_of(section, "profile", 90.0)
    first, last = entries[0].along.place[[0, -1]]
    for place, share in ((first, -1.0), (0.5 * (first + last), 0.0), (last + 20.0, 1.0)):
        (new, *_) = surveys.with_values(section, "profile", np.array([place]), None)
        assert survey_error([Hidden("tilt", 2.0)], [new], entries) == pytest.approx(2.0 * share)


def _judged(kind, name, verdict, names, *, families=(), members=(), own=None):
    truth = {"name": "case", "kind": kind, "source": "newton", "lambda": 20.0,
             "effects": {name: {"amplitude": 1.0}} if name else {},
             "parameters": {"strength": 20.0}}  # fmt: skip
    said = digest(truth, verdict, names).model_copy(
        update={"families": list(families), "members": list(members), "family_of": own or {}}
    )
    return ByCode(Judged(truth, said))


@pytest.mark.parametrize(
    ("case", "right"),
    [
        (_judged("single", "shaking", "identified", ["shaking"], own={"shaking": "physics"}), True),
        (_judged("single", "softening", "identified", ["shaking"], own={"shaking": "physics"}),
         False),
        (_judged("single", "pool", "identified", ["pool_on_the_left"],
                 own={"pool_on_the_left": "water"}), True),
        (_judged("single", "pool", "identified", ["shaking"], own={"shaking": "physics"}), False),
        (_judged("single", "pool", "identified", [], families=["water"]), True),
        (_judged("single", "pool", "ambiguous", ["pool"], own={"pool": "water"}), False),
        (_judged("single", "viscosity", "identified", [], families=["physics"],
                 members=["bingham", "rate_strengthening"]), True),
        (_judged("single", "viscosity", "identified", [], families=["physics"],
                 members=["shaking"]), False),
        (_judged("single", "pool", "identified", ["pool", "shaking"],
                 own={"pool": "water", "shaking": "physics"}), False),
        (_judged("outside", "wave", "identified", ["shaking"], own={"shaking": "physics"}), False),
    ],
)  # fmt: skip
def test_a_name_or_a_family_is_right(case, right):
    assert case.right is right


@pytest.mark.parametrize(
    ("names", "found"),
    [(("pool", "shaking"), True), (("shaking", "pool_on_the_left"), True), (("shaking",), False),
     (("shaking", "bingham"), False), (("pool", "pool_on_the_left"), False)],
)  # fmt: skip
def test_a_pair_is_found_by_the_names_of_both(names, found):
    own = {"pool": "water", "pool_on_the_left": "water", "shaking": "physics", "bingham": "physics"}
    one = _judged("pair", "shaking", "identified", list(names), own=own).judged
    truth = {**one.truth, "effects": {"shaking": {}, "pool": {}}}
    case = ByCode(replace(one, truth=truth))
    assert case.found_pair is found and not case.right
    assert score_by_codes([case.judged])["shares"]["pairs"]["hits"] == found


def test_pairs_are_of_two_families_that_can_act_on_one_section(benchmark):
    wanted = {"cases": 12, "kinds": ["pair", "single", "null"]}
    own = replace(benchmark, plan=benchmark.plan.model_copy(update=wanted))
    row = plan_by_codes(own)
    pairs = [one for one in row if one.kind == "pair"]
    assert len(pairs) == 4 and all(len(one.effects) == 2 for one in pairs)
    for one in pairs:
        first, second = (THINGS[name] for name in one.effects)
        assert first.families and second.families and not first.families & second.families
        section = benchmark.sections_of(one.source)[one.section]
        assert not any(thing.applies(section.scene) for thing in (first, second))


def test_score_counts_each_kind():
    null = _judged("null", None, "adequate", [])
    accused = _judged("null", None, "identified", ["shaking"], own={"shaking": "physics"})
    found = _judged("single", "pool", "identified", ["pool"], own={"pool": "water"})
    unseen = _judged("single", "pool", "adequate", [])
    like = _judged("outside", "wave", "identified", ["shaking"], own={"shaking": "physics"})
    honest = _judged("outside", "regaining", "unknown_effect", [])
    cases = [null, accused, found, unseen, like, honest]
    document = score_by_codes([one.judged for one in cases])
    hits = {name: (share["hits"], share["n"]) for name, share in document["shares"].items()}
    assert hits["nulls_attributed"] == (1, 2)
    assert hits["right"] == (1, 2)
    assert hits["right_of_named"] == (1, 2)  # the accused null was named, wrongly
    assert hits["explained_away"] == (1, 2)
    assert hits["explained_unlike"] == (0, 2)
    assert document["families"]["water"]["hits"] == 1
    assert document["cases"][2]["right"]
    worse = replace(found.judged, digest=found.judged.digest.model_copy(update={
        "final": found.judged.digest.base}))  # fmt: skip
    assert score_by_codes([worse])["shares"]["held_out_falls"]["hits"] == 0


def test_page_has_every_figure_and_every_case(tmp_path):
    cases = [
        _judged("null", None, "adequate", []),
        _judged("single", "pool", "identified", [], families=["water"]),
        _judged("outside", "wave", "identified", ["shaking"], own={"shaking": "physics"}),
    ]
    text = generated(cases, score_by_codes([one.judged for one in cases]), "pictures")
    assert "| nulls to which something is attributed | 0 % (0-79), 0 of 1 |" in text
    assert "**missed**" in text, "the stranger is explained away"
    assert text.count("| case | newton |") == 3
    assert "| pool | 20 | identified | water | yes |" in text
    assert "| 10-25 | 1 of 1 | 1 of 1 | 0 of 1 |" in text and "| 60 and more | 0 of 0 |" in text
    for path in draw_all(tmp_path, cases):
        assert path.stat().st_size > 5000


def test_the_stretch_that_is_stated_is_compared_with_what_fails():
    def one(place, left, begin, end, p, axis="x_m"):
        case = _judged("single", "pool", "adequate", []).judged
        case.truth["fails"] = [
            {"measurement": "surface", "axis": axis, "place": place, "left": left}
        ]  # fmt: skip
        window = WindowDigest(measurement="surface", begin=begin, end=end, p=p)
        return replace(case, digest=case.digest.model_copy(update={"window": window}))

    place = [0.0, 10.0, 20.0, 30.0]
    half = one(place, [0.1, -4.0, 3.0, 0.2], 20.0, 30.0, 0.01)
    whole = one(place, [0.1, -4.0, 3.0, 0.2], 10.0, 20.0, 0.01)
    unsure = one(place, [0.1, -4.0, 3.0, 0.2], 0.0, 0.0, 0.5)
    found = regions([half, whole, unsure])
    assert found["space"] == {"cases": 2, "precision": 0.75, "recall": 0.75, "f1": 0.75}
    assert found["time"] == {"cases": 0, "precision": None, "recall": None, "f1": None}
    late = one([1.0, 2.0, 4.0], [0.0, 0.0, 5.0], 4.0, 4.0, 0.01, "time_s")
    assert regions([late])["time"]["f1"] == 1.0


@pytest.mark.slow
def test_a_case_states_how_far_codes_differ(benchmark, tmp_path):
    section, planned = benchmark.sections["embankment"], plan_by_codes(benchmark)[0]
    made = Made({}, [], np.array([[0.0, 1.0], [1.0, 2.0]]))
    errors = {"toe_runout": CodeError(std=2.0)}
    wanted = SourcePlan(strength=0.03, effects=0.1, error=errors)
    write_case(section, planned, made, Places(tmp_path), 40.0, wanted)
    question = load_diagnosis_question(Places(tmp_path).case(planned.name))
    assert question.synthetic and question.source_errors["toe_runout"].std == 2.0
    assert question.source_strength == 0.03 and question.source_effects == 0.1


def test_what_the_fourth_set_hides_lies_within_what_its_cases_state():
    """Else no diagnosis that believes what it is told could name it."""
    fourth = load_benchmark(f"{FOLDER}/foreign_fourth.yaml")
    assert fourth.plan.stated is not None
    for section in fourth.sections_of("smoothed_particles").values():
        stated = fourth.plan.stated.sensitivities(section)
        (top,) = (one for one in stated if one["kind"] == "zone_boundary")
        std = {(z, one["property"]): one["std"] for one in stated if one["kind"] == "property"
               for z in one["zones"]}  # fmt: skip
        moved = {vertex["move"][1] for vertex in top["vertices"]}
        assert max(abs(a) for pair in THINGS["boundary"].sizes for a in pair) <= 2.0 * min(moved)
        for name in ("soil_strength", "soil_density"):
            sizes = fourth.plan.sizes.get(name, THINGS[name].sizes)
            for factor in (a for pair in sizes for a in pair):
                for number, zone in enumerate(section.scene.zones):
                    soil = section.scene.materials[zone.material]
                    if soil.liquefied:
                        continue
                    hidden = Hidden(name, factor, {"zone": float(number)})
                    other = THINGS[name].scene(section.scene, hidden)
                    changed = other.materials[other.zones[number].material]
                    for key in ("friction_deg", "cohesion_kpa", "density"):
                        off = abs(getattr(changed, key) - getattr(soil, key))
                        assert off <= 2.5 * std.get((zone.name, key), off)


@pytest.mark.slow
def test_a_case_says_what_its_plan_states(tmp_path):
    fourth = load_benchmark(f"{FOLDER}/foreign_fourth.yaml")
    section = fourth.sections_of("smoothed_particles")["embankment"]
    planned = plan_by_codes(fourth)[0]
    made = Made({}, [], np.array([[100.0, 2.0], [120.0, 5.0]]))
    places = Places(tmp_path)
    write_case(section, planned, made, places, 40.0, None, fourth.plan.stated)
    question = read_yaml(places.case(planned.name) / "inversion.yaml")
    assert question["sensitivities"] == fourth.plan.stated.sensitivities(section)


def test_the_page_says_how_far_the_strength_was_off():
    one = Slide("adequate", hidden=False, off=0.01, std=0.05, base_off=np.log(1.25))
    far = replace(one, verdict="ambiguous", hidden=True, off=np.log(2.0))
    assert one.held(0.0) and not far.held(0.0) and far.held(0.4)
    text = shown({"some": [one, one, far]})
    assert "| nothing was hidden | 2 | 1 % | 1 % | 25 % | 25 % |" in text
    assert "| said: ambiguous | 1 | 100 % | 100 % | 25 % | 25 % |" in text
    every = slides_by_set()
    parts = {"strength": shown(by_other_codes(every)), "widened": widened(every)}
    for name, part in parts.items():
        before, after = around(PAGE, name)
        assert part in PAGE.read_text(encoding="utf-8")[len(before) : -len(after)]
    assert worth(every) == track_record(), "out of date: see benchmarks.studies.strength_by_verdict"


def test_a_strength_is_widened_by_what_is_beyond_the_fits():
    draw = np.random.default_rng(3)
    fits, unseen = 0.05, 0.2
    off = draw.normal(0.0, np.hypot(fits, unseen), 400)
    found = [Slide("suspect", hidden=True, off=one, std=fits, base_off=one) for one in off]
    assert beyond(found) == pytest.approx(unseen, abs=0.03)
    assert beyond([replace(one, off=0.2 * one.off) for one in found]) == 0.0
    # The score of a Gaussian against its integral of (F - step)^2.
    x = np.linspace(-3.0, 3.0, 60001)
    step = x >= 0.1  # the truth, where the middle is at 0
    want = np.trapezoid((norm.cdf(x, scale=0.2) - step) ** 2, x)
    assert replace(found[0], off=0.1, std=0.16).crps(0.12) == pytest.approx(want, rel=1e-3)
