"""True and false are no numbers, however deep in a document."""

from __future__ import annotations

import shutil

import pytest

from geometry.measurements import load_measurements
from geometry.scene import load_scene
from pipeline.cli import InputError
from pipeline.config import load_config


@pytest.fixture
def lsfd(root, tmp_path):
    """A copy of the Lower San Fernando dam."""
    return shutil.copytree(root / "case_histories/lower_san_fernando", tmp_path / "lsfd")


@pytest.mark.parametrize(
    ("old", "new", "field"),
    [
        ("spacing: 1.0", "spacing: true", "spacing"),
        ("water_level: 35.9", "water_level: false", "water_level"),
        ("friction_deg: 37.0", "friction_deg: true", "friction_deg"),
    ],
)
def test_of_a_scene(lsfd, old, new, field):
    path = lsfd / "scene.yaml"
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(InputError, match=f"{field}: (true|false): a number is wanted here"):
        load_scene(path)


def test_of_measurements(lsfd):
    path = lsfd / "measurements.yaml"
    text = path.read_text()
    path.write_text(text.replace("std_m: 5.75", "std_m: true", 1))
    with pytest.raises(InputError, match="std_m: true: a number is wanted here"):
        load_measurements(lsfd)


def test_of_settings():
    with pytest.raises(InputError, match="simulation.duration_s: true: a number is wanted here"):
        load_config(None, ["simulation.duration_s=true"])
    assert load_config(None, ["simulation.early_stop=false"]).simulation.early_stop is False
