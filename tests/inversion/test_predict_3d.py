"""Prediction in three dimensions: exceedance against a closed form, and the whole way of a user."""

from __future__ import annotations

import json
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.special import ndtr

import flowslide
from benchmarks.verification.three_dimensions import slab_scene
from flowslide.command_line import main
from geometry.scenes3d.scene3d import load_scene_3d
from geometry.terrain.raster import Raster, read_raster, write_raster
from inversion.engines.body_engine import BodyEngine, BodyStore
from inversion.prediction.hydrograph import passed
from inversion.prediction.in_plan import exceedance, prediction_setup
from inversion.prediction.known_strength import KnownStrength, parse_strength, placed
from pipeline.cli import InputError, WorkFailed
from pipeline.config import SimulationSettings
from pipeline.files import write_text, yaml_text

QUICK = ["--set", "simulation.duration_s=8", "--threads", "1", "--quiet"]


@pytest.fixture
def gully(tmp_path):
    """A body of two soils on a slope, from rasters."""
    pytest.importorskip("rasterio", reason="needs the extra `terrain`")
    folder = tmp_path / "gully"
    folder.mkdir()
    x, y = np.meshgrid(np.arange(0.0, 37.0), np.arange(0.0, 9.0), indexing="ij")
    base = -0.2 * x + 0.02 * (y - 4.0) ** 2
    body = np.where((x > 4.0) & (x < 14.0), 4.0, 0.0)
    for name, values in (("base", base), ("surface", base + body)):
        write_raster(Raster((0.0, 0.0), 1.0, values), folder / f"{name}.tif")
    terrain = {
        "surface": "surface.tif", "base": "base.tif",
        "zones": [{"name": "dam", "material": "soil", "plan": [[10, 0], [16, 0], [16, 9], [10, 9]]},
                  {"name": "slimes", "material": "soil"}],
        "materials": {"soil": {"friction_deg": 0, "cohesion_kpa": 8, "liquefied": True}},
    }  # fmt: skip
    document = {
        "name": "gully",
        "spacing": 2.0,
        "terrain": terrain,
        "lines": {"foot": [[17, 0], [17, 9]]},
    }
    write_text(folder / "scene3d.yaml", yaml_text(document))
    return folder


def of(zone: str) -> KnownStrength:
    return KnownStrength((zone,), 4.0, 1.0, "lognormal")


def test_exceedance_is_the_share_of_strengths_with_a_thicker_deposit():
    scores = np.linspace(-3.0, 3.0, 7)[:, None]
    slopes = np.array([[0.5, 1.0], [2.0, 0.0]])
    kept = [SimpleNamespace(thickness=2.0 - score * slopes) for score in scores[:, 0]]
    drawn = np.random.default_rng(1).standard_normal((2000, 1))
    found = SimpleNamespace(scores=scores, sample_scores=drawn)
    (over_two, over_three) = exceedance(found, kept, (1.999, 3.0))
    # Thickness 2 - z s > 3 where z < -1 / s; nothing moves at the last pixel.
    expected = ndtr(-1.0 / np.maximum(slopes, 1e-9))
    assert over_three == pytest.approx(expected, abs=0.03)
    assert over_two[1, 1] == 1.0 and over_two[0, 1] == pytest.approx(0.5, abs=0.03)


def test_a_strength_belongs_to_its_zone_alone(gully):
    scene = load_scene_3d(gully)
    setup = prediction_setup(scene, SimulationSettings(), [of("slimes")])
    soil = setup.scene_at(np.array([3.0])).soil
    strength = {zone.name: soil.materials[zone.material].cohesion_kpa for zone in soil.zones}
    assert strength == {"dam": 8.0, "slimes": 3.0}
    assert setup.at(np.array([3.0])).values == [3.0]


@pytest.mark.slow
def test_a_prediction_leaves_maps_curves_and_a_document(gully, tmp_path, capsys):
    out = tmp_path / "out"
    asked = ["predict", str(gully), "--residual-strength", "slimes=2.5+-1", "--thicker-than",
             "2,1", "--out", str(out), *QUICK]  # fmt: skip
    main(asked)
    said = capsys.readouterr().out
    assert "toe runout (m)" in said and "runout middle" in said
    document = json.loads((out / "prediction.json").read_text())
    assert len(document["runs"]) == 15 and document["strengths"][0]["zones"] == ["slimes"]
    maps = [read_raster(out / f"exceedance_{thickness}m.tif").values for thickness in (1, 2)]
    assert np.all(maps[0] >= maps[1]) and maps[0].max() > 0.8 and maps[1].min() == 0.0
    # Places beyond the foot are reached the more rarely the farther they are.
    line = maps[0][4:].mean(axis=1)
    assert np.all(np.diff(line) <= 0.0) and line[0] > line[-1]
    areas = [one["area_m2"] for one in document["inundation"]]
    assert areas[0]["5"] >= areas[0]["50"] >= areas[0]["95"] and areas[0]["5"] >= areas[1]["5"]
    weak, strong = document["runs"][0]["predicted"], document["runs"][-1]["predicted"]
    assert weak["toe_runout_m"] > strong["toe_runout_m"] + 1.0
    page = (out / "prediction.html").read_text()
    assert page.count("data:image/png") == 2 and "thicker than" in page
    assert page.count("data:image/svg+xml;base64") == 1
    told = {one["name"]: one["quantiles"] for one in document["quantities"]}
    (line,) = document["hydrographs"]
    table = np.genfromtxt(out / "hydrograph.csv", delimiter=",", names=True)
    for percent in ("5", "50", "95"):
        released = line["volume"][percent][-1]
        assert released == pytest.approx(told["volume across foot"][percent], abs=0.01)
        assert passed(table[f"foot_{percent}"]) == pytest.approx(released, rel=1e-5)
    assert told["peak across foot"]["50"] > 0.0 and line["volume"]["50"][-1] > 0.0
    # What was run is kept: the same question again simulates nothing.
    kept = sorted((out / "runs").glob("*.npz"))
    stamps = [path.stat().st_mtime_ns for path in kept]
    main([*asked[:5], "3", *asked[6:]])
    assert [path.stat().st_mtime_ns for path in sorted((out / "runs").glob("*.npz"))] == stamps
    assert len(kept) == 15


def test_a_section_over_its_width_takes_strengths_by_zone_as_well(tmp_path):
    write_text(tmp_path / "scene.yaml", yaml_text(slab_scene(spacing=2.0)))
    section = {"file": "scene.yaml", "width_m": 12.0}
    write_text(tmp_path / "scene3d.yaml", yaml_text({"name": "slab", "section": section}))
    scene = load_scene_3d(tmp_path)
    setup = prediction_setup(scene, SimulationSettings(duration_s=3.0), [of("bank")])
    engine = BodyEngine(BodyStore(tmp_path / "runs", threads=1))
    weak, strong = engine.predict([setup.at(np.array([kpa])) for kpa in (5.0, 60.0)])
    toe = setup.targets.names.index("toe_runout_m")
    assert weak.values[toe] > strong.values[toe] + 2.0
    thickness = engine.kept_maps(setup.at(np.array([5.0]))).thickness
    assert engine.store.computed == 2  # the third was kept
    plane = setup.before.before
    assert thickness.sum() == pytest.approx(plane.values.sum(), rel=0.01)


def test_a_run_that_fails_is_reported_with_its_reason(gully, tmp_path):
    setup = prediction_setup(
        load_scene_3d(gully), SimulationSettings(time_step_s=10.0), [of("slimes")]
    )
    engine = BodyEngine(BodyStore(tmp_path, threads=1))
    (found,) = engine.predict([setup.at(np.array([4.0]))])
    assert found.failed and found.reason and np.isnan(found.values).all()
    with pytest.raises(WorkFailed, match="15 of 15 simulations failed"):
        flowslide.predict(
            gully, ["4+-1"], threads=1,
            settings=flowslide.load_settings(None, ["simulation.time_step_s=10"]),
        )  # fmt: skip


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (["--from-blow-counts"], "--from-blow-counts: not in three dimensions"),
        (["--residual-strength", "4+-1", "--seeds", "-2"], "--seeds -2: at least 0"),
        (["--residual-strength", "clay=4+-1"], "zone 'clay' is not in the scene"),
        (["--residual-strength", "4+-1", "--thicker-than", "0"], "must be greater than 0 m"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(gully, more, words):
    with pytest.raises(InputError, match=words):
        main(["predict", str(gully), *more, *QUICK])


def test_all_liquefied_zones_are_meant_unless_some_are_named(gully):
    scene = load_scene_3d(gully)
    liquefied = [zone.name for zone in scene.soil.zones]
    (both,) = placed([parse_strength("4+-1", "lognormal")], liquefied, scene.soil)
    assert both.zones == ("dam", "slimes")
