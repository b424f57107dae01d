"""Pictures of packed data: what they show is what is there, and errors are one line."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.image import imread

from gns.data.metadata import read_metadata
from gns.data.shard import Shard
from pipeline.cli import InputError
from report.pictures import packed_data
from tests.commands import gns as main


def test_a_run(packed, tmp_path, capsys):
    main(["show", f"{packed}:7", "--out", str(tmp_path / "run.png")])
    text = capsys.readouterr().out
    entries = {run.run: run for run in read_metadata(packed).runs("train")}
    points, frames = entries[7].points, entries[7].frames
    assert f"template c): {points} points, {frames} frames" in text
    picture = imread(tmp_path / "run.png")
    assert picture.shape[1] > 1200
    ground = np.abs(picture[..., :3] - np.array([163, 155, 143]) / 255).max(axis=2) < 0.01
    assert ground.mean() > 0.01, "the ground is drawn"


def test_an_overview_of_a_folder_and_of_a_shard(packed, tmp_path, monkeypatch):
    seen = []
    drawn = packed_data.save_overview
    monkeypatch.setattr(
        packed_data, "save_overview", lambda runs, *rest: (seen.append(runs), drawn(runs, *rest))
    )
    main(["show", str(packed), "--out", str(tmp_path / "all.png")])
    main(["show", str(packed / "test_000.npz"), "--out", str(tmp_path / "one.svg")])
    everything, shard = seen
    assert len(everything) == 30 and {one.split for one in shard} == {"test"}
    metadata = read_metadata(packed)
    for split in ("train", "valid", "test"):
        listed = [(one.template, one.points, one.frames) for one in metadata.runs(split)]
        own = [one for one in everything if one.split == split]
        assert [(one.template, one.points, one.frames) for one in own] == listed
    assert all(
        one.cohesion == pytest.approx(18.7e3 / (1800 * 9.81 * 2), rel=0.02) for one in everything
    )
    assert max(one.travel for one in everything) > 1.0
    assert (tmp_path / "all.png").stat().st_size > 10_000


@pytest.mark.slow
def test_water_and_fixed_bodies_are_drawn(packed, tmp_path):
    """Only that nothing stumbles over them; what they look like is for eyes."""
    from dataclasses import replace

    shard = Shard(packed / "valid_000.npz")
    run = shard.read_run(shard.run_numbers[0])
    fixed = np.where(run.facts.zone == 0, 1, 0).astype(np.int8)
    facts = replace(run.facts, type=fixed, phreatic_line=np.array([[0.0, 9.0], [60.0, 4.0]]))
    packed_data.save_run_picture(replace(run, facts=facts), tmp_path / "wet.png", "wet")
    packed_data.save_run_picture(run, tmp_path / "dry.png", "wet")
    line = np.array([42, 111, 168]) / 255
    wet, dry = (
        np.sum(np.abs(imread(tmp_path / name)[..., :3] - line).max(axis=2) < 0.02)
        for name in ("wet.png", "dry.png")
    )
    assert wet > dry + 100


@pytest.mark.parametrize(
    ("data", "out", "message"),
    [
        ("PACKED:99", "a.png", r"no run 99; it holds 30 runs, 0 to 29"),
        ("PACKED/test_000.npz:0", "a.png", r"no run 0; it holds 6 runs, \d+ to \d+"),
        ("PACKED", "a.gif", r"suffix '.gif'; allowed are .png, .svg, .pdf"),
        ("nowhere", "a.png", "holds no packed data"),
        ("PACKED/metadata.json", "a.png", "cannot be read, damaged or not packed data"),
    ],
)
def test_errors(data, out, message, packed, tmp_path):
    with pytest.raises(InputError, match=message) as caught:
        main(["show", data.replace("PACKED", str(packed)), "--out", str(tmp_path / out)])
    assert "\n" not in str(caught.value)
