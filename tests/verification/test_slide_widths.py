"""The study of slides of known width: what is drawn, and what is imitated."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.studies import slide_widths as study
from pipeline.config import load_config


def test_every_section_has_narrow_and_wide_slides():
    widths = np.array([study.width_of(number) for number in range(study.SLIDES)])
    low, high = study.WIDTHS
    assert low <= widths.min() < 1.1 * low and 0.9 * high < widths.max() <= high
    classes = np.floor(study.SLIDES * np.log(widths / low) / np.log(high / low)).astype(int)
    assert sorted(classes) == list(range(study.SLIDES))
    names = np.array([study.section_of(number).name for number in range(study.SLIDES)])
    for section in study.SECTIONS:
        own = widths[names == section]
        assert len(own) == 8 and own.min() < 5.5 and own.max() > 8.0


def test_a_slide_has_whole_cells_and_room_beyond_open_ends():
    for number in range(3):
        section = study.section_of(number)
        solid = study.solid_of(number, section)
        _, scene = next(study.drawn(number, section))
        walled = solid.walled(scene)
        cells = solid.section.width_m / scene.cell_size
        assert cells == pytest.approx(round(cells))
        room = study.ROOM if section.scene.domain.walls == "open" else 0.0
        assert walled.domain.x_min <= section.scene.domain.x_min - room + scene.spacing
        assert (walled.domain.walls, walled.spacing) == ("closed", study.spacing_of(section))


def test_the_amplitude_that_makes_a_toe_is_found(monkeypatch):
    """A plane section whose toe falls in proportion to the amplitude of an effect."""
    section = study.section_of(0)
    foot = section.scene.foot(section.survey.side)
    values, _ = next(study.drawn(0, section))

    def runs(scene, settings):
        return 20.0 - 10.0 * sum(scene.effects.values())

    monkeypatch.setattr(study, "plane", runs)
    monkeypatch.setattr(study, "deposit_of", lambda section, run: run)
    monkeypatch.setattr(study.surveys, "toe_of", lambda section, run: foot - run)
    one = {
        "true": dict(zip(section.parameters.names, values.tolist(), strict=True)),
        "toe_m": {"slide": 13.0, "twin": 20.0}, "width": 2.5,
    }  # fmt: skip
    found = study.imitated(0, one, load_config(None))
    assert found == {name: pytest.approx(0.7, abs=0.02) for name in study.FLANKS}
    one["toe_m"]["slide"] = 19.5
    assert study.imitated(0, one, load_config(None)) == {}
