"""Places that are sought: names that say where, and a price for looking."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
import pytest
from scipy.special import expit

from diagnosis.case import diagnosis_case
from diagnosis.diagnose import diagnose
from diagnosis.hypotheses import ground
from diagnosis.hypotheses.ground import bump_at
from diagnosis.hypotheses.model import Candidate, amplitude_of
from diagnosis.hypotheses.registry import assumed_otherwise
from diagnosis.hypotheses.strength import PLACES, neighbours, part_at
from diagnosis.options import Options
from geometry.case import load_case
from inversion.estimation.forward import SectionSetup
from inversion.problem.state import State
from pipeline.cli import InputError
from tests.diagnosis.straight import SIZE, Straight, X, errors, truth

EDGES = np.linspace(-1.0, 47.0, 13)


@pytest.fixture
def setup(embankment) -> SectionSetup:
    return diagnosis_case(load_case(embankment), spacing_m=2.0).setup


def test_the_neighbours_of_a_part_lie_a_step_away(setup):
    scene = setup.scene
    found = neighbours(scene, "central_block")
    assert len(found) == 10, "four sides out, two in, as a whole both ways along both axes"
    assert all(part_at(name).candidate.name == name for name in found)
    again = neighbours(scene, found[0])
    assert again and found[0] not in again and "part" not in again
    layer = neighbours(scene, "upper_layer")
    assert any("_x_" in name for name in layer), "a layer may end somewhere"
    assert all("_to_" in name for name in layer)
    assert neighbours(scene, "pool") == []


def test_moving_the_sides_leads_from_any_part_to_any_other(setup):
    """Every place can be reached, and the number of them is what the evidence pays for."""
    reached, waiting = set(), ["left_stretch"]
    while waiting:
        for name in neighbours(setup.scene, waiting.pop()):
            if name not in reached:
                reached.add(name)
                waiting.append(name)
    assert 0.3 * PLACES < len(reached) < 3.0 * PLACES


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
    near, far = ground.neighbours(scene, "bump_near_the_left_foot")
    assert {near, far} == {"bump_15_m_before_the_left_foot", "bump_9.6_m_before_the_left_foot"}
    assert "bump_12_m_before_the_left_foot" in ground.neighbours(scene, near)


def test_a_hypothesis_names_a_place(setup):
    changed = assumed_otherwise(setup, [], {"part_x_20_to_30": 0.5}, "h.yaml").scene
    assert changed.effects["strength_contrast"]["x_m"] == 25.0


class Patchy(Straight):
    """The straight model; a stretch of the profile may lie higher, and its place is sought."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self.candidates = [one for one in self.candidates if one.name in ("late", "like_bend")]
        self.candidates += [self._candidate(f"from_{a}_to_{a + 4}") for a in (0, 4, 8)]

    def _candidate(self, name: str) -> Candidate:
        ladder = (-2.0, -1.0, -0.4, 0.4, 1.0, 2.0)
        return Candidate(name, "strength", name, "m", -3.0, 3.0, ladder, placed=78)

    def neighbours(self, name: str) -> list[str]:
        if not name.startswith("from"):
            return []
        _, first, _, last = name.split("_")
        a, b = int(first), int(last)
        moved = [(a - 1, b), (a + 1, b), (a, b - 1), (a, b + 1), (a - 1, b - 1), (a + 1, b + 1)]
        return [f"from_{i}_to_{j}" for i, j in moved if 0 <= i < j < len(EDGES)]

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
    """What a stretch that lies up to 1 m higher changes, (SIZE,)."""
    _, first, _, last = name.split("_")
    found = np.zeros(SIZE)
    left, right = EDGES[int(first)], EDGES[int(last)]
    found[1:25] = expit((X - left) / 2.0) * expit((right - X) / 2.0)
    return found


def test_a_stretch_is_found_where_it_is():
    model = Patchy(truth({}) + 2.5 * patch("from_5_to_10") + errors(3))
    found = diagnose(model, Options())
    assert found.decision.verdict == "identified"
    assert found.decision.final.model.names == ("from_5_to_10",)
    assert found.decision.final.model.fit.x[-1] == pytest.approx(2.5, abs=0.6)
    one = {c.name: c for c in found.explanation.candidates}["from_5_to_10"]
    assert one.choices == 78, "its evidence pays for the places"
    space, alone = (model.space([amplitude_of(c)]) for c in (one, replace(one, choices=1)))
    assert space.ln_prior_width - alone.ln_prior_width == pytest.approx(np.log(78))
    kept = {c.name for c in found.explanation.candidates}
    assert {c.name for c in model.candidates} == kept, "what promised nothing is off trial again"
    assert found.explanation.names and set(found.explanation.names) == kept


def test_a_stretch_at_a_given_place_is_not_moved():
    model = Patchy(truth({}) + 1.8 * patch("from_4_to_8") + errors(3))
    found = diagnose(model, Options())
    assert found.decision.final.model.names == ("from_4_to_8",)
    assert found.decision.final.model.fit.space.effects[0].choices == 1


@pytest.mark.slow
def test_noise_names_no_place():
    """Of slides that hide nothing as few are explained by a part as without the search."""
    named = 0
    for seed in range(30):
        found = diagnose(Patchy(truth({}) + errors(200 + seed)), Options(draws=400))
        named += bool(found.decision.final.model.names)
    assert named <= 2
