from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

from mpm_taichi.trajectory import Run, nearest_frame
from pipeline import extras
from pipeline.cli import InputError
from report.pictures import simulated_run
from report.pictures.colouring import COLOURS, colouring_of, material_colours, rounded_up
from report.pictures.frame import (
    draw_frame,
    overlays,
    paint_body,
    profile_overlay,
    toe_overlay,
    view_limits,
)
from report.style import DPI
from tests.mpm_taichi.ballistic import FAST, fly, make_scene


@pytest.fixture
def run() -> Run:
    return fly(make_scene(1, water=7.0), FAST)


def rgb(path, frame: int = 0) -> np.ndarray:
    with Image.open(path) as image:
        image.seek(frame)
        return np.asarray(image.convert("RGB")).astype(int)


@pytest.mark.parametrize("colour", COLOURS)
def test_a_picture_of_each_quantity(tmp_path, run, colour):
    simulated_run.save_picture(run, tmp_path / "x.png", colour=colour)
    picture = rgb(tmp_path / "x.png")
    assert picture.shape[1] == round(simulated_run.WIDTH_IN * DPI)
    assert len(np.unique(picture @ [65536, 256, 1])) > 50
    assert [path.name for path in tmp_path.iterdir()] == ["x.png"]


def test_water_stays_where_nobody_knows_where_the_points_went():
    pool = {"water_level": 7.0, "phreatic_line": [[0, 7], [9, 7], [25, 3], [60, 3]]}
    run = fly(make_scene(1).changed(**pool), FAST)
    levels = {}
    for known in (True, False):
        last = run.positions[-1] if known else np.full_like(run.positions[-1], np.nan)
        shown = replace(run, positions=np.concatenate([run.positions[:-1], last[None]]))
        ax = Figure().subplots()
        soil = draw_frame(ax, shown, 0, colour="material")
        before = soil.water.line.get_ydata().copy()
        assert soil.water.face is not None, "the pool follows the soil"
        soil.water.show(run.frames - 1)
        levels[known] = before, soil.water.line.get_ydata()
    np.testing.assert_array_equal(*levels[False])
    assert not np.array_equal(*levels[True], equal_nan=True)


def test_points_are_drawn_where_they_are(run):
    figure = Figure(figsize=(6, 3), dpi=100)
    canvas = FigureCanvasAgg(figure)
    ax = figure.add_axes((0.1, 0.1, 0.85, 0.85))
    draw_frame(ax, run, -1, colour="material")
    canvas.draw()
    picture = np.asarray(canvas.buffer_rgba())[::-1, :, :3]
    shell = tuple(int(material_colours(run.scene)["shell"][i : i + 2], 16) for i in (1, 3, 5))
    inside = run.positions[-1][run.material == 1].mean(axis=0)  # the middle of the flown block
    column, row = ax.transData.transform(inside).round().astype(int)
    assert tuple(picture[row, column]) == shell
    assert ax.get_aspect() == 1.0


def test_the_body_fills_gaps_and_keeps_the_outline():
    x, y = np.meshgrid(np.arange(4, 20, dtype=float), np.arange(4, 12, dtype=float))
    positions = np.stack([x, y], axis=-1)
    positions[:, 8:, 0] += 1.0  # a crack two spacings wide ...
    positions[:, 12:, 0] += 3.0  # ... and one of four
    positions = np.concatenate([positions.reshape(-1, 2), [[np.nan, 0.0], [999.0, 5.0]]])
    values = np.arange(len(positions), dtype=float)
    body = paint_body(positions, values, extent=(0, 40, 0, 16), shape=(64, 160), reach=1.3)
    inside = ~body.mask
    row = inside[32]  # y = 8
    centres = (np.arange(160) + 0.5) / 4
    assert row[(centres > 4.2) & (centres < 15.8)].all()
    assert not row[(centres > 17) & (centres < 19)].any()
    outer = np.argwhere(inside)
    assert outer[:, 0].min() / 4 >= 3.7 and (outer[:, 0].max() + 1) / 4 <= 11.3
    assert body[32, 16] == values[np.argmin(np.hypot(*(positions[:-2] - [4.1, 8.1]).T))]
    assert paint_body(
        positions[-2:], values[-2:], extent=(0, 4, 0, 4), shape=(8, 8), reach=1
    ).mask.all()


def test_panels_show_the_moments_asked_for(tmp_path, run):
    simulated_run.save_picture(run, tmp_path / "one.png")
    simulated_run.save_picture(run, tmp_path / "three.png", times=[0.0, 1.0, run.time[-1]])
    assert rgb(tmp_path / "three.png").shape[0] > 2 * rgb(tmp_path / "one.png").shape[0]
    assert nearest_frame(run, run.settings.duration_s) == run.frames - 1
    for time in (-1.0, 99.0, np.nan):
        with pytest.raises(InputError, match=f"no frame at {time:g} s"):
            nearest_frame(run, time)


def test_vector_formats(tmp_path, run):
    simulated_run.save_picture(run, tmp_path / "x.svg")
    assert ET.parse(tmp_path / "x.svg").getroot().tag.endswith("svg")
    assert (tmp_path / "x.svg").stat().st_size < 400_000  # the points are an image in it


def test_an_overlay_is_drawn_and_kept_in_view(run):
    overlay = overlays(profile_overlay([5, 60, 90], [5, 4, 2]), toe_overlay(95.0, 2.0))
    plain, _ = view_limits(run)
    (left, right), _ = view_limits(run, overlay)
    assert plain[1] < 95 < right
    ax = Figure().add_subplot()
    draw_frame(ax, run, overlay=overlay)
    labels = ax.get_legend_handles_labels()[1]
    assert {"measured profile", "measured toe", "before", "water level"} <= set(labels)


def test_one_stray_point_does_not_shrink_the_picture():
    run = fly(make_scene(1, spacing=0.25), FAST)
    before = view_limits(run)
    run.positions[:, 7] += [400.0, 300.0]
    run.positions[3, 8] = np.nan
    assert np.allclose(view_limits(run), before, atol=1.0)
    draw_frame(Figure().add_subplot(), run)


def test_gif_moves_and_keeps_white_paper(tmp_path, run):
    simulated_run.save_animation(run, tmp_path / "x.gif", frames=6)
    with Image.open(tmp_path / "x.gif") as image:
        assert image.n_frames == 6
    first, last = rgb(tmp_path / "x.gif", 0), rgb(tmp_path / "x.gif", 5)
    assert (np.abs(first - last).sum(axis=2) > 60).mean() > 0.01
    assert tuple(first[2, 2]) == (255, 255, 255)


def test_an_animation_frame_equals_the_picture_of_that_moment(tmp_path, run):
    """Only what moves is redrawn; the result must not differ from drawing everything."""
    sheet = simulated_run._Sheet(run, [0], colour="displacement", overlay=None, title=None)
    *_, last = (image.copy() for image in sheet.images(range(run.frames)))
    simulated_run.save_picture(run, tmp_path / "x.png")
    difference = np.abs(rgb(tmp_path / "x.png") - last[..., :3].astype(int)).max(axis=2)
    assert (difference > 40).mean() < 1e-3


def test_mp4(tmp_path, run):
    ffmpeg = pytest.importorskip("imageio_ffmpeg", reason="needs the extra `video`")
    simulated_run.save_animation(run, tmp_path / "x.mp4", frames=5, hold_s=0.5)
    count, seconds = ffmpeg.count_frames_and_secs(str(tmp_path / "x.mp4"))
    assert count == 5 + 10
    assert seconds == pytest.approx(count / 20, abs=0.06)


def test_mp4_without_the_extra_says_what_to_do(tmp_path, run, monkeypatch):
    monkeypatch.setattr(extras, "find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"flowslide\[video\]"):
        simulated_run.save_animation(run, tmp_path / "x.mp4")
    assert not list(tmp_path.iterdir())


def test_speed_is_that_of_free_flight(run):
    values = colouring_of(run, "speed").values
    block = run.material == 1
    assert values(0)[block] == pytest.approx(np.hypot(9, 4), rel=0.05)
    assert not values(4)[~block].any()


def test_colour_scales():
    assert [rounded_up(v) for v in (0, 0.9, 1, 1.2, 52, 81)] == [1, 1, 1, 1.5, 60, 100]
    colours = material_colours(make_scene())
    assert colours["liquefied fill"] == "#d55e00" and len(set(colours.values())) == 2


def test_errors_are_one_line(tmp_path, run):
    with pytest.raises(InputError, match="allowed are .png, .svg, .pdf"):
        simulated_run.save_picture(run, tmp_path / "x.bmp")
    with pytest.raises(InputError, match="allowed are .mp4, .gif"):
        simulated_run.save_animation(run, tmp_path / "x.avi")
    with pytest.raises(InputError, match="colour 'rainbow' is unknown; allowed: displacement"):
        simulated_run.save_picture(run, tmp_path / "x.png", colour="rainbow")
    empty = Run.empty(run.scene, FAST, reason="it burnt")
    with pytest.raises(InputError, match="no frames to draw .it burnt"):
        simulated_run.save_picture(empty, tmp_path / "x.png")
