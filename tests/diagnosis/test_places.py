"""Places that are sought: names that say where, cells that add up, and a price for looking."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binomtest

from diagnosis.adequacy.compare import compare
from diagnosis.case import diagnosis_case
from diagnosis.diagnose import diagnose
from diagnosis.hypotheses.ground import bump_at, bump_search
from diagnosis.hypotheses.model import Candidate, Search, amplitude_of
from diagnosis.hypotheses.registry import assumed_otherwise, searches_of
from diagnosis.hypotheses.strength import LAYERS, STRIPS, part_at, part_search
from diagnosis.options import Options
from diagnosis.selection.explain import explain
from geometry.case import load_case
from inversion.estimation.forward import Setup
from inversion.problem.state import State
from mpm_taichi.effects.strength_contrast import multiplier
from pipeline.cli import InputError
from tests.diagnosis.straight import SIZE, Straight, X, errors, truth

EDGES = np.linspace(-1.0, 47.0, 13)


@pytest.fixture
def setup(embankment) -> Setup:
    return diagnosis_case(load_case(embankment), spacing_m=2.0).setup


def test_every_rectangle_of_cells_is_a_place_with_a_name_of_its_own(setup):
    found = part_search(setup.scene)
    assert found is not None and len(found.runs) == STRIPS * LAYERS
    strips, layers = STRIPS * (STRIPS + 1) // 2, LAYERS * (LAYERS + 1) // 2
    assert len(found.places) == strips * layers - 1, "all of the soil is no part"
    assert set(found.runs) <= set(found.places)
    for name, within in found.places.items():
        one = part_at(name)
        assert one is not None and one.candidate.name == name
        assert len(set(within)) == len(within) > 0


def test_the_windows_of_the_cells_add_up_to_that_of_their_rectangle(setup):
    """Else the sum of what the cells change would be of another place than the name says."""
    found = part_search(setup.scene)
    spots = np.random.default_rng(1).uniform((0.0, 0.0), (64.0, 5.0), (4000, 2))

    def window(name: str) -> np.ndarray:
        numbers = {"x_m": 0.0, "half_width_m": 1e6, "y_m": 0.0, "half_height_m": 1e6, "edge": 0.5}
        entry = part_at(name).change(setup, 1.0).scene.effects["strength_contrast"]
        return np.log(multiplier(setup.scene, spots, 1.0, {**numbers, **entry}))

    name, within = max(found.places.items(), key=lambda item: len(item[1]) * (len(item[1]) < 9))
    total = sum(window(found.runs[k]) for k in within)
    assert np.mean(np.abs(total - window(name))) < 0.1 * window(name).mean()


def test_a_part_is_where_its_name_says(setup):
    entry = part_at("part_x_-3.5_to_12_y_2_to_6").change(setup, 0.4).scene.effects
    contrast = entry["strength_contrast"]
    assert contrast["x_m"] == 4.25 and contrast["half_width_m"] == 7.75
    assert contrast["y_m"] == 4.0 and contrast["half_height_m"] == 2.0
    stretch = part_at("part_x_10_to_20").change(setup, 0.4).scene.effects["strength_contrast"]
    assert "half_height_m" not in stretch
    assert part_at("part") is None and part_at("upper_layer") is None
    with pytest.raises(InputError, match="from a lower to a higher x"):
        part_at("part_x_20_to_10")


def test_a_ridge_is_where_its_name_says(setup):
    scene = setup.scene
    one = bump_at(scene, "bump_6.5_m_before_the_right_foot")
    x, y = np.array(one.change(setup, 1.5).scene.ground.points).T
    assert x[np.argmax(y)] == scene.foot("right") + 6.5 and y.max() == 1.5
    assert bump_at(scene, "bump_near_the_right_foot") is None
    found = bump_search(scene, "left")
    assert set(found.places) == set(found.runs) and len(found.runs) == 8
    assert all(bump_at(scene, name) is not None for name in found.runs)


def test_a_hypothesis_names_a_place(setup):
    changed = assumed_otherwise(setup, [], {"part_x_20_to_30": 0.5}, "h.yaml").scene
    assert changed.effects["strength_contrast"]["x_m"] == 25.0
    assert set(searches_of(setup.scene)) == {"bump_left", "bump_right", "part"}


class Patchy(Straight):
    """The straight model; a stretch of the profile may lie higher, and its place is sought."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self.candidates = [one for one in self.candidates if one.name in ("late", "like_bend")]
        self.candidates.append(self._candidate("from_0_to_3"))

    def _candidate(self, name: str) -> Candidate:
        ladder = (-2.0, -1.0, -0.4, 0.4, 1.0, 2.0)
        return Candidate(name, "strength", name, "m", -3.0, 3.0, ladder, placed="stretch")

    def search(self, kind: str) -> Search:
        assert kind == "stretch"
        count = len(EDGES) - 1
        places = {
            f"from_{a}_to_{b}": range(a, b)
            for a in range(count)
            for b in range(a + 1, count + 1)
            if b - a < count
        }
        return Search([f"from_{a}_to_{a + 1}" for a in range(count)], 0.4, places)

    def add_placed(self, name: str, *, choices: int = 1) -> Candidate | None:
        one = replace(self._candidate(name), choices=choices)
        self.candidates = [*(c for c in self.candidates if c.name != name), one]
        return one

    def drop_placed(self, names: Iterable[str]) -> None:
        self.candidates = [c for c in self.candidates if c.name not in set(names)]

    def predict(self, states: Sequence[State]) -> np.ndarray:
        plain = [
            replace(s, effects=tuple(e for e in s.effects if not e[0].startswith("from")))
            for s in states
        ]
        rows = super().predict(plain)
        for row, state in zip(rows, states, strict=True):
            for name, size in state.effects:
                if name.startswith("from"):
                    row += size * patch(name)
        return rows


def patch(name: str) -> np.ndarray:
    """What a stretch that lies 1 m higher changes, (SIZE,)."""
    _, first, _, last = name.split("_")
    found = np.zeros(SIZE)
    found[1:25] = (X >= EDGES[int(first)]) & (X < EDGES[int(last)])
    return found


def test_a_stretch_is_found_where_it_is():
    hidden = truth({}) + 1.8 * patch("from_4_to_9")
    model = Patchy(hidden + errors(3))
    found = diagnose(model, Options())
    assert found.decision.verdict == "identified"
    assert found.decision.final.model.names == ("from_4_to_9",)
    assert found.decision.final.model.fit.x[-1] == pytest.approx(1.8, abs=0.5)
    (one,) = [c for c in found.explanation.candidates if c.choices > 1]
    assert one.choices == 12 * 13 // 2 - 1
    alone = replace(one, choices=1)
    space = model.space([amplitude_of(one)])
    assert space.ln_prior_width - model.space([amplitude_of(alone)]).ln_prior_width == (
        pytest.approx(np.log(one.choices))
    )
    assert {c.name for c in model.candidates} == {"late", "like_bend", "from_0_to_3", "from_4_to_9"}


def test_what_is_adequate_is_not_searched():
    model = Patchy(truth({}) + errors(5))
    found = diagnose(model, Options())
    assert found.decision.verdict == "adequate"
    assert all(one.choices == 1 for one in found.explanation.candidates)


def test_the_price_of_looking_everywhere_is_honest():
    """Under noise alone the smallest p of all, sought places among them, is seldom small.

    Sought whatever the base model says, which `suspect` above 1 does.
    """
    always = Options(suspect=1.1, draws=400)
    sought, found = 0, []
    for seed in range(120):
        model = Patchy(truth({}) + errors(100 + seed))
        explained = explain(model, compare(model, always), always)
        sought += any(one.choices > 1 for one in explained.candidates)
        found.append(explained.scores.p_largest)
    assert sought > 60
    assert binomtest(int(np.sum(np.array(found) < 0.1)), 120, 0.1).pvalue > 0.01
