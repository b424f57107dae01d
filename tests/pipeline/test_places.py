"""Shipped folders are found from anywhere; what a user has of the same name comes first."""

import pytest

from pipeline.places import CASES, ROOT, names_of, resolve, shipped


@pytest.mark.parametrize("name", ["case_histories", "models", "config"])
def test_shipped_folders_are_found_from_anywhere(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert shipped(name) == ROOT / name and shipped(name).is_dir()


def test_installed_data_is_used_where_there_is_some(tmp_path, monkeypatch):
    monkeypatch.setattr("pipeline.places.ROOT", tmp_path)
    (tmp_path / "flowslide_data" / "models").mkdir(parents=True)
    assert shipped("models") == tmp_path / "flowslide_data" / "models"


def test_a_path_wins_then_the_current_folder_then_the_shipped_one(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    name = "lower_san_fernando"
    assert resolve(name, CASES) == ROOT / CASES / name
    (tmp_path / CASES / name).mkdir(parents=True)
    assert resolve(name, CASES).resolve() == tmp_path / CASES / name
    (tmp_path / name).mkdir()
    assert resolve(name, CASES).resolve() == tmp_path / name
    assert str(resolve("nowhere", CASES)) == "nowhere"


def test_names_are_those_here_and_those_shipped(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "models" / "mine").mkdir(parents=True)
    (tmp_path / "models" / "mine" / "model.pt").touch()
    assert names_of("models", "model.pt") == ["mine", "thrust"]
