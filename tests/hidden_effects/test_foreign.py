"""Truths by other codes: what is hidden acts; a slide is read by the measurements themselves."""

from pathlib import Path

import numpy as np
import pytest

from benchmarks.hidden_effects.foreign.hidden import FAMILIES, THINGS, Hidden
from benchmarks.hidden_effects.foreign.loading import Loading, Moment
from benchmarks.hidden_effects.foreign.slide import SOURCES, Slide, rooms, source
from benchmarks.hidden_effects.making import surveys
from benchmarks.hidden_effects.making.benchmark import load_benchmark
from benchmarks.hidden_effects.making.by_other_codes import plan_by_codes
from benchmarks.hidden_effects.making.sections import load_section
from pipeline.cli import InputError
from pipeline.random_numbers import Stream

FOLDER = "benchmarks/hidden_effects/sections"
SECTIONS = {name: load_section(f"{FOLDER}/{name}") for name in ("tailings_dam", "reservoir_dam")}


def _section_for(name):
    return next(s for s in SECTIONS.values() if not THINGS[name].applies(s.scene))


def _later(loading, time_s=4.0):
    n = len(loading.points)
    return Moment(
        time_s, loading.points.position + np.array([30.0, 0.0]), np.ones((n, 2)), np.full(n, 0.2),
        np.full(n, 0.5),
    )  # fmt: skip


@pytest.mark.parametrize("name", list(THINGS))
def test_every_thing_changes_the_slide_it_is_hidden_in(name):
    section, thing = _section_for(name), THINGS[name]
    one = thing.draw(section.scene, Stream(3))
    without = Loading.of(section.scene, [], seed=1)
    with_it = Loading.of(section.scene, [one], seed=1)
    moment = _later(without, 9.0 if name == "aftershock" else 4.0)
    moment = moment if with_it.scene == without.scene else None
    acts = [
        with_it.scene != without.scene,
        with_it.base_share != without.base_share,
        with_it.settled != without.settled,
        thing.survey is not None and np.abs(thing.survey(one, np.array([0.5, 1.0]))).max() > 0.1,
        moment is not None and not np.allclose(with_it.cohesion(moment), without.cohesion(moment)),
        moment is not None
        and not np.allclose(with_it.acceleration(moment), without.acceleration(moment)),
    ]
    assert sum(acts) == 1  # by one way, and one alone
    assert thing.families <= set(FAMILIES)
    assert Hidden.of(name, one.entry) == one


def test_strength_that_does_not_change_is_asked_for_once():
    section = SECTIONS["tailings_dam"]
    for name, thing in THINGS.items():
        if thing.changes or thing.applies(section.scene):
            continue
        loading = Loading.of(section.scene, [thing.draw(section.scene, Stream(3))], seed=1)
        assert np.array_equal(loading.cohesion(loading.still), loading.cohesion(_later(loading))), (
            name
        )


def test_every_family_and_strangers_can_be_hidden():
    families = {family for thing in THINGS.values() for family in thing.families}
    assert families == set(FAMILIES)
    assert sum(thing.stranger for thing in THINGS.values()) >= 4


@pytest.mark.slow
def test_the_first_sets_deal_nothing_that_came_later():
    folder = Path(__file__).parents[2] / "benchmarks" / "hidden_effects"
    fourth, fifth = (
        {name for one in plan_by_codes(load_benchmark(folder / file)) for name in one.effects}
        for file in ("foreign_fourth.yaml", "foreign_fifth.yaml")
    )
    assert not any(THINGS[name].later for name in fourth)
    assert any(THINGS[name].later for name in fifth)


def test_what_cannot_act_is_refused():
    with pytest.raises(InputError, match="pool: the section has water"):
        Loading.of(SECTIONS["reservoir_dam"].scene, [Hidden("pool", 0.5)], seed=1)
    with pytest.raises(InputError, match="'poltergeist' is unknown"):
        Loading.of(SECTIONS["tailings_dam"].scene, [Hidden("poltergeist", 0.5)], seed=1)
    with pytest.raises(InputError, match="source: 'oracle' is unknown"):
        source("oracle")


def test_every_source_hides_what_there_is():
    for one in SOURCES.values():
        assert set(one.hides) <= set(THINGS)


def test_water_carries_the_submerged_weight():
    scene = SECTIONS["tailings_dam"].scene
    loading = Loading.of(scene, [Hidden("pool", 0.5)], seed=1)
    x, y = loading.points.position.T
    push = loading.acceleration(loading.still)
    deep = y < 0.3 * y.max()
    assert push[deep, 1] * loading.density[deep] == pytest.approx(9.81 * 1000.0)
    assert np.all(push[y > 0.8 * y.max()] == 0.0)


@pytest.mark.parametrize("squeezed", [1.0, 0.9])
def test_room_of_points_is_their_area(squeezed):
    spacing = 1.0
    x, y = np.meshgrid(np.arange(40) + 0.5, np.arange(20) + 0.5)
    points = np.column_stack([x.ravel(), squeezed * y.ravel()])
    assert rooms(points, spacing).sum() == pytest.approx(800.0 * squeezed, rel=0.02)
    slide = Slide(SECTIONS["tailings_dam"].scene.changed(spacing=1.0), np.zeros(800, int),
                  np.array([np.column_stack([x.ravel(), y.ravel()]), points]),
                  np.array([0.0, 1.0]), True)  # fmt: skip
    assert slide.area_kept == pytest.approx(squeezed, abs=0.01)


@pytest.mark.slow
def test_own_slide_reads_as_the_judge_reads_it():
    section = SECTIONS["tailings_dam"]
    scene = section.parameters.scene(section.scene, np.array([20.0, 34.0]))
    slide = source("own").simulate(scene, [], duration_s=40.0, frames=80, seed=3, threads=1)
    entries = surveys.entries_of(section, "history", surveys.toe_of(section, slide.deposit(scene)))
    read = slide.reading(entries, scene)
    toe = read[section.survey.profile.points]
    assert 5.0 < toe < 60.0
    assert slide.area_kept == pytest.approx(1.0, abs=0.03)
    longer = source("own").simulate(scene, [Hidden("weak_base", 0.5)], duration_s=40.0, frames=80,
                                    seed=3, threads=1)  # fmt: skip
    assert longer.reading(entries, scene)[section.survey.profile.points] > toe + 3.0
