"""Kept runs: whatever happened to a file, it is read right or computed again."""

from __future__ import annotations

import zipfile
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from geometry.scenes.fill import fill
from geometry.scenes.scene import scene_from_mapping
from geometry.survey.slide_duration import SlideDuration
from geometry.survey.toe_history import ToeHistory
from inversion.back_analysis import result_builder
from inversion.engines.content_store import read_arrays, write_arrays
from inversion.engines.run_store import KeptRun, RunStore, arrays_of_run, run_of_arrays
from inversion.estimation.forward import HistoryReader, Prediction, SectionSetup
from pipeline.config import SimulationSettings


def test_the_effects_of_the_section_are_among_the_remarks():
    scene = scene_from_mapping(
        {
            "name": "block",
            "domain": {"x_min": 0, "x_max": 9, "y_max": 9},
            "ground": {"points": [[0, 0], [9, 0]]},
            "zones": [{"name": "a", "material": "a", "polygon": [[2, 0], [6, 0], [6, 4], [2, 4]]}],
            "materials": {"a": {"friction_deg": 0, "cohesion_kpa": 2, "liquefied": True}},
            "spacing": 1.0,
        }
    )
    setup = SectionSetup(scene, SimulationSettings(), None, None, {})
    assert result_builder.simulated_with(setup) == []
    shaken = scene.changed(effects={"shaking": 0.2})
    (line,) = result_builder.simulated_with(replace(setup, scene=shaken))
    assert line.startswith("simulated with shaking 0.2 g: the ground went on shaking")


@pytest.fixture
def kept() -> KeptRun:
    random = np.random.default_rng(0)
    return KeptRun(
        initial=random.normal(size=(50, 2)).astype(np.float32),
        final=random.normal(size=(50, 2)).astype(np.float32),
        zone=np.arange(50, dtype=np.int32),
        initial_volume=np.ones(50, np.float32),
        vertical_stress=random.normal(size=50).astype(np.float32),
        status="finished",
        reason="",
        end_s=12.5,
        at_rest=True,
        wall_time_s=0.3,
    )


def test_volumes_are_kept_where_soil_has_changed_its_own(tmp_path, kept):
    path = tmp_path / "run.npz"
    write_arrays(path, arrays_of_run(kept))
    assert read_arrays(path, run_of_arrays).volume is None
    swollen = replace(kept, volume=np.linspace(1.0, 1.1, 50))
    write_arrays(path, arrays_of_run(swollen))
    assert np.array_equal(read_arrays(path, run_of_arrays).volume, swollen.volume)


@pytest.mark.slow
def test_a_flipped_byte_is_noticed_or_does_no_harm(tmp_path, kept):
    path = tmp_path / "run.npz"
    write_arrays(path, arrays_of_run(kept))
    whole = path.read_bytes()
    unreadable = 0
    for place in range(0, len(whole), 3):
        for flip in (1, 64, 255):
            damaged = bytearray(whole)
            damaged[place] ^= flip
            path.write_bytes(damaged)
            back = read_arrays(path, run_of_arrays)
            unreadable += back is None
            if back is not None:
                assert back.status == "finished" and back.end_s == kept.end_s
                for name in ("initial", "final", "zone", "vertical_stress"):
                    assert np.array_equal(getattr(back, name), getattr(kept, name))
    assert unreadable > len(whole) / 2


def test_a_slide_that_was_cut_off_and_a_number_that_was_not_read_are_reported():
    settings = SimulationSettings(duration_s=4.0)
    numbers = np.array([17.3, np.nan])
    still = Prediction(numbers[:1], np.zeros(1))
    assert result_builder.doubts(still, settings) == []
    moving = Prediction(numbers, np.zeros(2), at_rest=False, reason="late toe: measured at 500 s")
    cut_off, not_read = result_builder.doubts(moving, settings)
    assert "still moved after 4 s" in cut_off and "duration_s" in cut_off
    assert "late toe: measured at 500 s" in not_read


@pytest.fixture
def sliding(monkeypatch):
    """Stands in for the solver: a block that slides 4 m to the left in 4 s and then rests."""
    import mpm_taichi.simulate

    scene = scene_from_mapping(
        {
            "name": "block",
            "domain": {
                "x_min": -100.0,
                "x_max": 100.0,
                "y_max": 50.0,
                "walls": "open",
                "left": "free",
                "right": "free",
            },
            "ground": {"points": [[-100.0, 0.0], [100.0, 0.0]]},
            "zones": [
                {
                    "name": "soil",
                    "polygon": [[0.0, 0.0], [10.0, 0.0], [10.0, 4.0], [0.0, 4.0]],
                    "material": "soil",
                }
            ],
            "materials": {"soil": {"friction_deg": 0.0, "cohesion_kpa": 5.0}},
            "spacing": 1.0,
        }
    )
    simulated = []

    def simulate_each(wanted, **options):
        for place, (one, _) in enumerate(wanted):
            simulated.append(one)
            before = fill(one).position.astype(np.float32)
            time = np.arange(7.0)
            way = np.minimum(time, 4.0)
            yield (
                place,
                SimpleNamespace(
                    scene=one,
                    initial_volume=fill(one).volume,
                    bulk_volume=fill(one).volume,
                    positions=before[None] - way[:, None, None] * np.array([1, 0], np.float32),
                    time=time,
                    zone=np.zeros(len(before), np.int32),
                    initial_stress=np.zeros((len(before), 4), np.float32),
                    status="finished",
                    reason="",
                    came_to_rest=True,
                    wall_time_s=0.1,
                ),
            )

    monkeypatch.setattr(mpm_taichi.simulate, "simulate_each", simulate_each)
    return scene, simulated


def test_what_hangs_on_the_whole_way_is_read_once_and_kept_without_frames(tmp_path, sliding):
    scene, simulated = sliding
    settings = SimulationSettings()
    about = {"confidence": "assumed", "source": "a test"}
    film = ToeHistory(name="film", type="toe_history", side="left", times_s=[1.0, 2.5, 9.0],
                      values_m=[0.0, 0.0, 0.0], std_m=1.0, **about)  # fmt: skip
    told = SlideDuration(name="told", type="slide_duration", value_s=3.0, std_s=1.0, **about)
    reader = HistoryReader([film, told], {"left": 0.0, "right": 10.0})
    filmed, timed = reader.wanted
    store = RunStore(tmp_path)
    (run,) = store.fetch([(scene, settings)], [reader])
    toe = run.readings[filmed].values
    assert toe - toe[0] == pytest.approx([0.0, 1.5, 3.0])
    assert run.readings[timed].values == pytest.approx([0.9 * 4.0])

    again = RunStore(tmp_path)
    # Another survey of the same quantity is read from the same run.
    resurveyed = film.model_copy(update={"name": "again", "values_m": [1.0, 2.0, 3.0]})
    (kept,) = again.fetch([(scene, settings)], [HistoryReader([resurveyed, told], reader.foot)])
    assert len(simulated) == 1 and again.computed == 0
    assert np.array_equal(kept.readings[filmed].values, toe)
    assert (tmp_path / next(iter(tmp_path.iterdir())).name).stat().st_size < 8000

    # Another quantity needs the run again; earlier readings stay.
    other = HistoryReader([film.model_copy(update={"times_s": [2.0, 3.0, 4.0]})], reader.foot)
    (kept,) = again.fetch([(scene, settings)], [other])
    assert len(simulated) == 2
    assert set(kept.readings) == {*reader.wanted, *other.wanted}
    assert set(read_arrays(next(iter(tmp_path.iterdir())), run_of_arrays).readings) == set(
        kept.readings
    )
    # The same measured from another foot is another quantity, but not for a duration.
    assert filmed not in HistoryReader([film], {"left": 1.0, "right": 10.0}).wanted
    assert timed in HistoryReader([told], {"left": 1.0, "right": 10.0}).wanted


def test_a_history_of_a_run_that_was_cut_off_is_reported_not_made_up(sliding):
    scene, _ = sliding
    told = SlideDuration(name="told", type="slide_duration", value_s=3.0, std_s=1.0,
                         confidence="assumed", source="a test")  # fmt: skip
    reader = HistoryReader([told], {"left": 0.0, "right": 10.0})
    (timed,) = reader.wanted
    from mpm_taichi.simulate import simulate_each

    ((_, run),) = simulate_each([(scene, SimulationSettings())])
    run.came_to_rest = False
    reading = reader.read(run)[timed]
    assert np.isnan(reading.values).all() and "stopped in motion" in reading.trouble
    run.status, run.reason = "failed", "energy balance"
    assert reader.read(run)[timed].trouble == "energy balance"


def test_a_kept_run_of_half_the_section_is_made_again(sliding, tmp_path):
    scene, simulated = sliding
    wanted = [(scene, SimulationSettings())]
    (kept,) = RunStore(tmp_path).fetch(wanted)
    (path,) = tmp_path.glob("*.npz")
    half = {
        name: getattr(kept, name)[::2] for name in ("initial", "final", "zone", "vertical_stress")
    }
    write_arrays(path, arrays_of_run(replace(kept, **half)))
    (again,) = RunStore(tmp_path).fetch(wanted)
    assert len(simulated) == 2 and len(again.initial) == len(kept.initial)


def test_a_header_that_claims_more_than_there_is_memory_is_damage(kept, tmp_path):
    path = tmp_path / "run.npz"
    write_arrays(path, arrays_of_run(kept))
    with zipfile.ZipFile(path) as file:
        parts = {name: file.read(name) for name in file.namelist()}
    claim = {"descr": "<f4", "fortran_order": False, "shape": (10**14, 2)}
    with zipfile.ZipFile(path, "w") as file:
        for name, content in parts.items():
            if name == "final.npy":
                with file.open(name, "w") as entry:
                    np.lib.format.write_array_header_1_0(entry, claim)
            else:
                file.writestr(name, content)
    assert read_arrays(path, run_of_arrays) is None
