"""Training of a direct model: runs -> weights.

In: the folder of `gns.direct.runs`. Out: the networks of a model, each as `network_<K>.pt` from 1
on and, while it trains, `state_<K>.pt`, from which a job that was killed goes on. Sections are
encoded once, one by one, so that what is learned from is in memory once, as the network sees it.
Every tenth block of ten scenes judges the model (`test`), the one before it
calibrates its intervals (`calibration`); the others train it.
"""

from __future__ import annotations

import hashlib
import math
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from gns import PHYSICS_VERSION
from gns.direct.arrivals import Arrivals
from gns.direct.network import (
    TURNED,
    Answer,
    DirectConfig,
    DirectModel,
    DirectNetwork,
    features,
    mirrored,
)
from gns.direct.runs import SlideRun, read_runs
from gns.direct.sections import Outcome, SectionColumns, outcome_of, section_of
from gns.training.optimizers import Optimizers
from pipeline.cli import InputError
from pipeline.files import atomic_path, content_hash

SPLITS = ("train", "calibration", "test")
#: Weight of the thickness next to the toes.
PROFILE = 1.0
#: Weight of the arrival times.
TIMES = 0.3
#: A likelihood alone counts those toes least whose error it expects to be large. So each toe's is
#: multiplied by (scale / TYPICAL)^BETA, both in heights (beta-NLL, Seitzer et al. 2022).
BETA, TYPICAL = 0.5, 0.1


@dataclass(frozen=True)
class Sample:
    """One run as the model sees it.

    Attributes:
        run: number of its scene; name: of the scene.
        section, outcome: see `gns.direct.sections`.
        times: arrival times, left toe, right toe and way, (3, S) [falls]; NaN of what does not
            move.
        split: which of SPLITS.
        seconds: of the run [s].
    """

    run: int
    name: str
    section: SectionColumns
    outcome: Outcome
    times: np.ndarray
    split: str
    seconds: float

    @property
    def acting(self) -> bool:
        """An effect acts."""
        return bool(np.any(self.section.effects))

    @property
    def template(self) -> str:
        """One of a to d, or what kind of dam."""
        return self.name.split("_")[0]


@dataclass(frozen=True)
class TrainingPlan:
    """How long and how fast.

    At `restart_at` a second cycle begins from the averaged weights, as a training of its own: its
    rate rises to `restart_share` of the first and falls again. One that is shorter has none.
    """

    steps: int = 28000
    restart_at: int = 20000
    restart_share: float = 0.5
    batch: int = 32
    rate: float = 2e-3
    warmup: int = 200
    save_every: int = 500
    decay: float = 0.05
    seed: int = 0

    @property
    def first_cycle(self) -> int:
        """Steps of the first cycle."""
        return min(self.restart_at, self.steps)

    @property
    def later(self) -> TrainingPlan:
        """The same for networks that begin as others ended: one cycle, like the second."""
        rate = self.restart_share * self.rate
        return replace(self, restart_at=self.steps, rate=rate)


def split_of(run: int) -> str:
    """The split of a run: by tens, so that every split has dams and templates alike."""
    place = (run // 10) % 10
    return "test" if place == 9 else "calibration" if place == 8 else "train"


def sample_of(run: SlideRun) -> Sample | None:
    """A run encoded; None where it left the columns."""
    section = _small(section_of(run.scene))
    outcome = outcome_of(section, run.initial, run.final, run.volume, run.scene.spacing)
    if outcome is None:
        return None
    origin = run.scene.origin
    return Sample(
        run.number,
        run.scene.name if origin is None else f"{origin.template}_{run.number}",
        section,
        outcome,
        times_of(section, run.arrivals),
        split_of(run.number),
        run.seconds,
    )


def times_of(section: SectionColumns, arrivals: Arrivals) -> np.ndarray:
    """Arrival times (3, S) [falls] of the left toe, the right toe and all soil on its way."""
    return np.concatenate([arrivals.toes, arrivals.way[None]]) / section.unit_s


def _small(section: SectionColumns) -> SectionColumns:
    """With its large arrays in the precision of the network: tens of thousands are kept."""
    share = section.zone_share.astype(np.float32)
    same = section.strength_share is section.zone_share
    strong = share if same else section.strength_share.astype(np.float32)
    return replace(section, zone_share=share, strength_share=strong)


def read_samples(folder: Path, splits: Sequence[str] = SPLITS) -> Iterator[Sample]:
    """The runs of a folder that are of some splits, encoded one by one.

    Raises:
        InputError: there are none of a split.
    """
    missing = list(splits)
    for run in read_runs(folder):
        if (split := split_of(run.number)) not in splits:
            continue
        if (sample := sample_of(run)) is not None:
            missing = [one for one in missing if one != split]
            yield sample
    if missing:
        raise InputError(f"{folder}: no run of the split {missing[0]}; two parts have all of them")


def inputs(samples: Iterable[Sample]) -> Tensor:
    """Features (N, channels, C), float32."""
    return torch.cat([_input(one) for one in samples])


def _input(one: Sample) -> Tensor:
    values = torch.as_tensor(one.section.values, dtype=torch.float32)[None]
    return features([one.section], one.outcome.toes_before[None], values)


def train(
    samples: Iterable[Sample],
    folder: Path,
    config: DirectConfig,
    plan: TrainingPlan,
    tell: Callable[[str], None] = print,
    *,
    alone: int | None = None,
    begin: DirectModel | None = None,
) -> DirectModel:
    """Train, or go on where a training of the same runs, size, plan and beginning stopped.

    Args:
        samples: read once; only those of the split `train` are learned from.
        folder: of the model.
        config: size of the networks, and how many.
        plan: how long.
        tell: called with a line at each save.
        alone: number of the only network to train, from 0, for several jobs; None: all.
        begin: networks whose weights the first so many of the model begin with; None: none.

    Raises:
        InputError: it is no beginning (`DirectModel.check_begin`).
    """
    model = DirectModel(config)
    if begin is not None:
        model.check_begin(begin)
    before = [] if begin is None else list(begin.networks)
    lessons = Lessons.of(one for one in samples if one.split == "train")
    for number in range(config.networks) if alone is None else [alone]:
        own = replace(plan, seed=plan.seed + number)
        first = before[number] if number < len(before) else None
        model.networks[number] = _network(lessons, folder, number + 1, config, own, tell, first)
    return model.eval()


@dataclass(frozen=True)
class Lessons:
    """What is learned from, N runs.

    Attributes:
        key: hash of all of it.
        seen: see `inputs`.
        toes: (N, 2); thickness: (N, C); times: (N, 3, S).
    """

    key: str
    seen: Tensor
    toes: Tensor
    thickness: Tensor
    times: Tensor

    @classmethod
    def of(cls, samples: Iterable[Sample]) -> Lessons:
        """Encoded one by one; no sample is kept."""
        rows = [
            (
                _input(one),
                *(
                    torch.as_tensor(value, dtype=torch.float32)[None]
                    for value in (one.outcome.toes, one.outcome.thickness, one.times)
                ),
            )
            for one in samples
        ]
        values = [torch.cat(column) for column in zip(*rows, strict=True)]
        return cls(_hash_of(values), *values)

    def __len__(self) -> int:
        return len(self.seen)

    def batch(self, drawn: Tensor, *, turned: bool) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """Features, toes, thickness and times of some, or of their mirror images."""
        seen, toes = self.seen[drawn], self.toes[drawn]
        thickness, times = self.thickness[drawn], self.times[drawn]
        if turned:
            return mirrored(seen), -toes.flip(1), thickness.flip(1), times[:, TURNED]
        return seen, toes, thickness, times


def _hash_of(values: Iterable[Tensor]) -> str:
    found = hashlib.sha256()
    for one in values:
        found.update(one.contiguous().numpy().data)
    return found.hexdigest()


def _network(
    lessons: Lessons,
    folder: Path,
    number: int,
    config: DirectConfig,
    plan: TrainingPlan,
    tell: Callable[[str], None],
    begin: DirectNetwork | None,
) -> DirectNetwork:
    """One network: the one that is there, or trained, from its state on if there is one."""
    key = content_hash(
        {
            "lessons": lessons.key,
            "begin": None if begin is None else _hash_of(begin.state_dict().values()),
            "config": {k: v for k, v in asdict(config).items() if k != "networks"},
            "plan": asdict(plan),
            "loss": [PROFILE, TIMES, BETA, TYPICAL],
            "physics_version": PHYSICS_VERSION,
        }
    )
    torch.manual_seed(plan.seed)
    network = DirectNetwork(config)
    if begin is not None:
        network.begin_with(begin)
    done, state = folder / f"network_{number}.pt", folder / f"state_{number}.pt"
    kept = _kept(done, key)
    if kept is not None:
        network.load_state_dict(kept["weights"])
        return network.eval()
    optimiser = optimiser_of(network, plan)
    average = {name: value.clone() for name, value in network.state_dict().items()}
    folder.mkdir(parents=True, exist_ok=True)
    first, kept = 0, _kept(state, key)
    if kept is not None:
        first, average = kept["step"], kept["average"]
        network.load_state_dict(kept["weights"])
        optimiser.load_state_dict(kept["optimiser"])
    began, running = time.perf_counter(), 0.0
    network.train()
    for step in range(first, plan.steps):
        if step == plan.first_cycle:
            network.load_state_dict(average)
            optimiser = optimiser_of(network, plan)
        numbers = torch.Generator().manual_seed(plan.seed * 1_000_003 + step)
        drawn = torch.randint(len(lessons), (plan.batch,), generator=numbers)
        torch.manual_seed(plan.seed * 1_000_003 + step)  # of what is dropped, also after a kill
        seen, *truth = lessons.batch(drawn, turned=step % 2 == 1)
        optimiser.set_rate(_schedule(step, plan))
        loss = loss_of(network(seen), *truth)
        optimiser.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(network.parameters(), 1.0)
        optimiser.step()
        running += float(loss.detach())
        keep = min(0.998, (step + 1) / (step + 10))
        for name, value in network.state_dict().items():
            average[name].lerp_(value, 1.0 - keep)
        if (step + 1) % plan.save_every == 0 or step + 1 == plan.steps:
            with atomic_path(state) as temporary:
                torch.save(
                    {
                        "key": key,
                        "step": step + 1,
                        "average": average,
                        "weights": network.state_dict(),
                        "optimiser": optimiser.state_dict(),
                    },
                    temporary,
                )
            pace = (time.perf_counter() - began) / (step + 1 - first)
            tell(f"step {step + 1}: loss {running / plan.save_every:.3f}, {1000 * pace:.0f} ms")
            running = 0.0
    network.load_state_dict(average)
    with atomic_path(done) as temporary:
        torch.save({"key": key, "weights": average}, temporary)
    state.unlink(missing_ok=True)
    return network.eval()


def optimiser_of(network: DirectNetwork, plan: TrainingPlan) -> Optimizers:
    """Of a network, as the training begins with it."""
    return Optimizers(
        list(network.parameters()),
        rate=plan.rate,
        muon_rate=plan.rate,
        decay=plan.decay,
        as_adam=True,
    )


def _kept(file: Path, key: str) -> dict[str, Any] | None:
    """What an earlier job of the same training left; None: nothing."""
    kept = torch.load(file, weights_only=True) if file.is_file() else None
    return kept if kept is not None and kept["key"] == key else None


def loss_of(answer: Answer, toes: Tensor, thickness: Tensor, times: Tensor) -> Tensor:
    """Mean negative log likelihood of Laplace errors; of the toes by their scale, see `BETA`."""
    toe = (answer.toes - toes).abs() / answer.toe_scale + answer.toe_scale.log()
    toe = toe * (answer.toe_scale.detach() / TYPICAL) ** BETA
    profile = (answer.thickness - thickness).abs()
    deposit = profile / answer.thickness_scale + answer.thickness_scale.log()
    moved = ((thickness > 0.0) | (answer.thickness > 0.0)).float()
    known = times.isfinite()
    off = (answer.log_times - torch.where(known, times, 1.0).log()).abs()
    arrival = (off / answer.time_scale + answer.time_scale.log()) * known
    return (
        toe.mean()
        + TIMES * arrival.sum() / known.sum().clamp(min=1)
        + PROFILE * (deposit * moved).sum() / moved.sum()
        + 2.0 * profile.mean()
    )


def answers(model: DirectModel, samples: list[Sample], batch: int = 64) -> Answer:
    """What a model predicts for samples."""
    parts = []
    with torch.no_grad():
        for place in range(0, len(samples), batch):
            some = samples[place : place + batch]
            parts.append(model(inputs(some)))
    return Answer(
        *(torch.cat([getattr(one, name) for one in parts]) for name in Answer.__dataclass_fields__)
    )


def _schedule(step: int, plan: TrainingPlan) -> float:
    """Share of the learning rate: a rise, then a cosine, in each cycle."""
    end, share = plan.first_cycle, 1.0
    if step >= end:
        step, end, share = step - end, plan.steps - end, plan.restart_share
    if step < plan.warmup:
        return share * (step + 1) / plan.warmup
    way = (step - plan.warmup) / max(end - plan.warmup, 1)
    return share * 0.5 * (1.0 + math.cos(math.pi * way))
