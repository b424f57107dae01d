"""Simulations in processes of their own, for several threads that ask."""

from concurrent.futures import CancelledError
from threading import Timer

import numpy as np
import psutil
import pytest

from geometry.scenes.scene import Scene, scene_from_mapping
from inversion.engines.run_store import RunStore
from inversion.engines.workers import Workers
from mpm_taichi.simulate import simulate_each
from pipeline.cli import WorkFailed
from pipeline.config import SimulationSettings

QUICK = SimulationSettings(duration_s=0.5)


def block(cohesion_kpa: float) -> Scene:
    """A block of 32 points."""
    return scene_from_mapping(
        {
            "name": "block",
            "domain": {"x_min": -20.0, "x_max": 30.0, "y_max": 20.0, "walls": "closed"},
            "ground": {"points": [[-20.0, 0.0], [30.0, 0.0]]},
            "zones": [
                {
                    "name": "soil",
                    "polygon": [[0.0, 0.0], [8.0, 0.0], [8.0, 4.0], [0.0, 4.0]],
                    "material": "soil",
                }
            ],
            "materials": {"soil": {"friction_deg": 0.0, "cohesion_kpa": cohesion_kpa}},
            "spacing": 1.0,
        }
    )


@pytest.fixture(scope="module")
def workers():
    """Two processes, which start once."""
    made = Workers(2)
    yield made
    made.close()


def test_runs_for_several_jobs_have_the_bits_of_runs_in_this_process(workers):
    finer = QUICK.model_copy(update={"courant": 0.1})
    asked = {
        "one": [(block(2.0), QUICK), (block(4.0), finer), (block(8.0), QUICK)],
        "other": [(block(16.0), QUICK)],
    }
    found = {name: {} for name in asked}

    def ask(name: str) -> None:
        found[name] = dict(workers.simulate(asked[name]))

    workers.side_by_side([lambda: ask("one"), lambda: ask("other")])
    for name, wanted in asked.items():
        own = dict(simulate_each(wanted, threads=1))
        assert own.keys() == found[name].keys()
        for place, run in own.items():
            assert np.array_equal(run.positions, found[name][place].positions)
            assert np.array_equal(run.stress, found[name][place].stress)


def test_the_error_of_one_job_ends_the_others_at_their_next_simulation():
    ours, ends = Workers(2), []

    def fail() -> None:
        raise ValueError("no such strength")

    def ask_on() -> None:
        try:
            while True:
                list(ours.simulate([(block(2.0), QUICK)]))
        except BaseException as error:
            ends.append(error)
            raise

    with pytest.raises(ValueError, match="no such strength"):
        ours.side_by_side([ask_on, fail, ask_on])
    assert len(ends) == 2
    with pytest.raises(CancelledError):
        list(ours.simulate([(block(2.0), QUICK)]))


@pytest.mark.slow
def test_a_process_that_is_killed_ends_all_jobs_with_one_line():
    """As the kernel does when memory ends."""
    others = psutil.Process().children(recursive=True)
    ours = Workers(2)
    (alone,) = ours.simulate([(block(2.0), QUICK)])
    assert alone[1].status != "failed"
    (own, *_) = [
        process
        for process in psutil.Process().children(recursive=True)
        if process not in others and "LokyProcess" in " ".join(process.cmdline())
    ]

    def ask_on() -> None:
        while True:
            list(ours.simulate([(block(2.0), QUICK), (block(3.0), QUICK)]))

    killer = Timer(0.3, own.kill)
    killer.start()
    with pytest.raises(WorkFailed, match="ended by the system, most often for want of memory"):
        ours.side_by_side([ask_on, ask_on])
    killer.join()


@pytest.mark.slow
def test_where_there_is_one_core_jobs_are_done_in_turn():
    done = []
    store = RunStore(None, threads=1)
    with store.workers():
        store.side_by_side([lambda: done.append("first"), lambda: done.append("then")])
    assert done == ["first", "then"]
