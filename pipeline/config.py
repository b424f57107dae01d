"""The settings of all stages: one model, one YAML file, one JSON schema.

`config/config.yaml` is these defaults written out as a manual; a test keeps the two equal. A file
given with `--config` and the `--set` options need state only what differs. Units are in the key
names and are converted where a value is used; the paper's values are in `config/paper.yaml`.
"""

from __future__ import annotations

import difflib
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    Field,
    SerializerFunctionWrapHandler,
    ValidationError,
    model_serializer,
    model_validator,
)

from pipeline.cli import InputError
from pipeline.documents import StrictDocument, schema_file_text
from pipeline.files import content_hash, file_or_within, parse_yaml, read_json, read_yaml

Model = TypeVar("Model", bound=BaseModel)


def _in_order(limits: tuple[float, float]) -> tuple[float, float]:
    if limits[0] > limits[1]:
        raise ValueError(f"the lower limit {limits[0]} is above the upper limit {limits[1]}")
    return limits


def _listed(value: Any) -> Any:
    """A single step as a list; 0 is none."""
    return ([value] if value else []) if isinstance(value, int) else value


def _ascending(steps: list[int]) -> list[int]:
    if steps != sorted(set(steps)):
        raise ValueError("allowed are steps in ascending order")
    return steps


NumberRange = Annotated[tuple[float, float], AfterValidator(_in_order)]
Steps = Annotated[
    list[Annotated[int, Field(gt=0)]], BeforeValidator(_listed), AfterValidator(_ascending)
]
CountRange = Annotated[tuple[int, int], AfterValidator(_in_order)]


Family = Literal[
    "template",
    "embankment_dam",
    "hydraulic_fill_dam",
    "embankment_on_foundation",
    "impoundment",
]
"""What a random scene may be: of the templates (a) to (e) by their weights, or (f) to (i)."""


class Settings(StrictDocument):
    """A group of settings."""


class TemplateShares(Settings):
    """How often each random template is drawn, as weights (they need not add up to 1)."""

    a: float = Field(1.0, ge=0, description="embankment in three layers")
    b: float = Field(1.0, ge=0, description="upstream tailings dam: shell and impounded layers")
    c: float = Field(1.0, ge=0, description="zoned dam: core, shells, foundation")
    d: float = Field(1.0, ge=0, description="random slope with an inner zone")
    e: float = Field(1.0, ge=0, description="blocks thrown onto an uneven base")

    @model_validator(mode="after")
    def _some_template_is_drawn(self) -> TemplateShares:
        if not sum(self.model_dump().values()) > 0:
            raise ValueError("at least one template needs a weight above 0")
        return self


class BlockSettings(Settings):
    """The blocks of template (e), at the size of scale_factor 1."""

    number: CountRange = Field((1, 3), description="fewest and most blocks in a scene")
    size_m: NumberRange = Field((10.0, 40.0), description="shortest and longest side, m")
    speed_m_per_s: NumberRange = Field(
        (0.0, 10.0), description="lowest and highest initial speed, m/s, in any direction"
    )

    @model_validator(mode="after")
    def _is_possible(self) -> BlockSettings:
        if self.number[0] < 1:
            raise ValueError(f"number starts at {self.number[0]}: at least 1 block")
        if self.size_m[0] <= 0:
            raise ValueError(f"size_m starts at {self.size_m[0]}: sides are longer than 0")
        if self.speed_m_per_s[0] < 0:
            raise ValueError(f"speed_m_per_s starts at {self.speed_m_per_s[0]}: at least 0")
        return self


class GeometrySettings(Settings):
    """How random scenes are drawn (paper, Fig. 3 and Table A.1)."""

    seed: int = Field(0, ge=0, description="with the scale and the index, decides a scene entirely")
    template_shares: TemplateShares = Field(
        default_factory=TemplateShares, description="weight of each template"
    )
    materials: Literal["wide", "paper"] = Field(
        "wide",
        description="strength ranges of Soil 1-3: the paper's, or wider ones that hold the case "
        "histories (Soil 3 from 1 to 60 kPa at the large scale)",
    )
    water_share: float = Field(
        0.25,
        ge=0,
        le=1,
        description="share of the scenes of templates (a) to (d) with a reservoir; 0 in the paper",
    )
    jitter: float = Field(
        0.0,
        ge=0,
        lt=1,
        description="each material point moves by up to jitter x spacing / 2 in x and y",
    )
    max_points: int = Field(
        6000, ge=100, description="scenes with more material points are drawn again"
    )
    min_points_per_zone: int = Field(
        20, ge=1, description="scenes with a smaller zone are drawn again"
    )
    blocks: BlockSettings = Field(
        default_factory=BlockSettings, description="the blocks of template (e)"
    )


class SimulationSettings(Settings):
    """How a scene is simulated by the material point method."""

    duration_s: float = Field(
        240.0,
        gt=0,
        description="longest motion, s: a run that comes to rest ends before; a scale has its own",
    )
    frame_interval: float = Field(
        0.4, gt=0, description="time between stored frames, in units of sqrt(spacing / gravity)"
    )
    courant: float = Field(
        0.3, gt=0, le=0.9, description="time step = courant x cell / (wave speed + |velocity|)"
    )
    time_step_s: float | None = Field(
        None, gt=0, description="fixed time step, s; null: from courant; a scale may have its own"
    )
    transfer: Literal["affine_flip", "flip", "apic", "pic"] = Field(
        "affine_flip", description="how velocities pass between material points and grid"
    )
    pic_rate_per_s: float = Field(
        1.0,
        ge=0,
        description="share of PIC mixed into affine_flip and flip, per second of motion, so that "
        "the damping does not depend on the time step",
    )
    local_damping: float = Field(
        0.0, ge=0, lt=1, description="Cundall's local damping during the runout; 0: none"
    )
    volumetric_averaging: bool = Field(
        True, description="average the volumetric strain over a cell (F-bar), against locking"
    )
    pressure_relaxation: float = Field(
        1.0,
        ge=0.05,
        description="rate at which the pressure of a point nears the mean of its cell, in units of "
        "wave speed / cell; F-bar is not stable without; no effect without volumetric_averaging",
    )
    pressure_smoothing: float = Field(
        0.02,
        ge=0,
        le=0.5,
        description="share of pressure_relaxation that also draws a cell's pressure towards a line "
        "through its neighbours, against pressures that alternate from cell to cell",
    )
    volume_correction: bool = Field(
        True, description="take back the volume that material points gain at the free surface"
    )
    initial_stress: Literal["settled", "k0", "gravity_on"] = Field(
        "settled",
        description="stress at t = 0: settled elastically, from K0 alone, or gravity at once",
    )
    k0: float | None = Field(
        None,
        gt=0,
        le=3,
        description="ratio of horizontal to vertical effective stress that settled and k0 start "
        "from; null: nu / (1 - nu) of each material",
    )
    water: Literal["buoyant", "pore_pressure"] = Field(
        "pore_pressure",
        description="pool and groundwater as pressure in and on the soil, or as reduced weight "
        "alone, which leaves out the thrust of the pool",
    )
    water_face: Literal["moving", "fixed"] = Field(
        "moving",
        description="of pore_pressure: the pool follows the soil, or the phreatic line stays",
    )
    early_stop: bool = Field(True, description="stop once the motion has ended")
    early_stop_energy_fraction: float = Field(
        0.001, gt=0, lt=1, description="ended: kinetic energy below this share of its peak ..."
    )
    early_stop_hold_s: float = Field(1.0, ge=0, description="... for this long, s")
    gravity_m_per_s2: float = Field(9.81, gt=0, description="gravity, m/s2")
    wall_contact: Literal["smooth", "no_slip"] = Field(
        "smooth", description="contact with the side walls of a closed domain"
    )
    energy_tolerance: float = Field(
        0.05,
        gt=0,
        description="a run whose energy balance is off by more than this share of the energy "
        "released is recorded as failed",
    )


class InversionSettings(Settings):
    """How strengths are found from measurements. The unknowns are in a case's inversion.yaml."""

    engine: str = Field(
        "mpm",
        description="what simulates: mpm, the material point method, gns, a learned simulator "
        "that is differentiated (Diff-GNS), mpm3d, the material point method over a width, or "
        "direct, a learned model without steps",
    )
    model: str = Field(
        "", description="of the engine gns: a folder with model.pt, or a name in models/"
    )
    outside_training: bool = Field(
        False,
        description="of gns and direct: answer also for a section far outside "
        "what the model has learned from",
    )
    paired_runs: int = Field(
        0,
        ge=0,
        le=32,
        description="of the engine direct: states at which the material point "
        "method also runs, to correct the answer; 0: none, and the model's own error counts",
    )
    surrogate_pairs: int = Field(
        5,
        ge=3,
        le=32,
        description="of the engine gns: states at which the material point method also runs, "
        "for its error",
    )
    method: Literal["gauss_newton", "lbfgsb"] = Field(
        "gauss_newton", description="bounded Gauss-Newton, or L-BFGS-B as in the paper"
    )
    spacing_factor: float = Field(
        1.0,
        gt=0,
        description="multiplies the spacing of every case: 2 is a quarter of the points and about "
        "six times as fast",
    )
    coarse_factor: float = Field(
        2.0,
        ge=1,
        description="of the engine mpm: how the answer changes (first iterations, other starts, "
        "jitter, variants, sensitivities) is found at this times the spacing that the case asks "
        "for; 1: everything at one spacing",
    )
    coarse_points: int = Field(
        400, ge=50, description="a section with fewer points at that spacing has no coarse runs"
    )
    check_share: float = Field(
        0.75,
        ge=0,
        le=1,
        description="the largest sensitivities, with this share of the variance, are run again at "
        "the spacing of the answer; 0: none",
    )
    tolerance_m2: float = Field(
        0.1,
        gt=0,
        description="loss `runout`: squared runout error that is good enough, m²; at most the "
        "variance of the survey's errors",
    )
    tolerance_misfit: float = Field(
        0.01,
        gt=0,
        description="loss `misfit`: the search ends when the next step would lower the sum of "
        "squared standardised differences by less",
    )
    max_iterations: int = Field(20, ge=1, description="of one search")
    max_runs: int = Field(150, ge=2, description="simulations of one search")
    starts: int = Field(
        3, ge=1, le=5, description="first guesses that are tried; the answer is of the question's"
    )
    step_to_noise: float = Field(
        5.0, gt=0, description="least effect of a finite difference, in units of the noise"
    )
    step_seeds: int = Field(
        4, ge=0, description="jitter seeds that measure the noise for the steps; 0: not measured"
    )
    noise_seeds: int = Field(
        8, ge=0, description="jitter seeds on which the answer is found again; 0: none"
    )
    noise_jitter: float = Field(
        0.5, gt=0, lt=1, description="points of these seeds move by up to this x spacing / 2"
    )
    variants: bool = Field(True, description="solve the variants of the question")
    sensitivities: bool = Field(True, description="solve its sensitivities")
    waterfall: bool = Field(True, description="solve the readings on the way to it")

    @model_validator(mode="after")
    def _pairs_are_enough(self) -> InversionSettings:
        if self.paired_runs in (1, 2):
            raise ValueError(f"paired_runs is {self.paired_runs}: none, or at least 3")
        return self


class PosteriorSettings(Settings):
    """How the whole posterior of a case is found."""

    coarse_runs: int = Field(
        128, ge=32, le=2048, description="runs spread over the whole prior, at the coarse spacing"
    )
    refined_runs: int = Field(
        64, ge=0, le=2048, description="further coarse runs where the posterior is"
    )
    fine_runs: int = Field(
        24, ge=4, le=512, description="pairs of coarse and fine runs there, for the correction"
    )
    confirming_runs: int = Field(
        8,
        ge=0,
        le=128,
        description="of mpm at draws of the posterior of a learned engine; 0: none",
    )
    live_points: int = Field(500, ge=50, description="of the nested sampler")
    draws: int = Field(4000, ge=200, le=100_000, description="from the posterior that are kept")
    seed: int = Field(0, ge=0, description="of designs, sampler and draws")


class JointSettings(Settings):
    """Over which slides one relation of the strength ratio is found."""

    cases: list[str] = Field(
        ["lower_san_fernando", "la_marquesa", "upper_san_fernando"],
        min_length=2,
        description="of `snakemake joint`: each slide once",
    )


class DiagnosisSettings(Settings):
    """How missing physics is found. What an engineer knows of a case is in its diagnosis.yaml."""

    spacing_factor: float = Field(
        1.0, gt=0, description="multiplies the spacing of every case, as for the back-analysis"
    )
    max_runs: int = Field(1400, ge=20, description="forward runs of one diagnosis")
    replicates: int = Field(
        8, ge=2, description="jitter seeds that measure the numerical noise at the fit"
    )
    noise_jitter: float = Field(
        0.5, gt=0, lt=1, description="points of these seeds move by up to this x spacing / 2"
    )
    second_transfer: Literal["flip", "apic"] = Field(
        "flip", description="transfer scheme of the paired run that enters the model's error"
    )
    finer: float = Field(
        2.0, gt=1, le=3, description="the runs with finer cells have the spacing / this"
    )
    finer_share: float = Field(
        1.0,
        ge=0,
        description="multiple of the difference to finer cells that is added to every prediction",
    )
    finer_share_std: float = Field(
        0.5, ge=0, description="its standard deviation; with both 0 no run has finer cells"
    )
    finer_runs: int = Field(
        3, ge=1, le=9, description="runs with finer cells behind the correction"
    )
    draws: int = Field(4000, ge=200, description="simulated noises behind every p value")
    starts: int = Field(3, ge=1, le=5, description="first guesses of the base model's calibration")
    rounds: int = Field(3, ge=1, le=5, description="effects that may be added one after another")
    refitted: int = Field(4, ge=1, description="candidates that are refitted in a round")
    finite_width: bool = Field(
        False,
        description="put on trial that the slide is three-dimensional; each of its runs costs tens "
        "of plane ones",
    )


class HiddenEffectsSettings(Settings):
    """The blind benchmark of the diagnosis. What is hidden is in the document it names."""

    benchmark: str = Field(
        "benchmarks/hidden_effects",
        min_length=1,
        description="what is to be made: a file, or its folder",
    )
    shares: int = Field(20, ge=1, le=999, description="jobs among which the cases are divided")
    variants: list[Literal["method", "no_model_error", "no_projection", "tangent_only"]] = Field(
        ["method", "no_model_error", "no_projection", "tangent_only"],
        min_length=1,
        description="how every case is judged: the method, and without one of its parts",
    )


class PackSettings(Settings):
    """How trajectories are packed for the learned simulator."""

    valid_share: float = Field(
        0.1, ge=0, lt=1, description="share of the runs of each template that choose a model"
    )
    test_share: float = Field(
        0.1, ge=0, lt=1, description="share of the runs of each template that judge it"
    )
    seed: int = Field(0, ge=0, description="decides which runs these are")
    runs_per_shard: int = Field(100, gt=0, description="runs in one file")

    @model_validator(mode="after")
    def _some_are_left(self) -> PackSettings:
        if self.valid_share + self.test_share >= 1.0:
            raise ValueError(
                f"valid_share {self.valid_share:g} and test_share {self.test_share:g} leave no "
                "run to learn from; their sum is below 1"
            )
        return self


def _default_training() -> dict[str, dict[str, int | float | bool | str | list[int]]]:
    coarse: dict[str, int | float | bool | str | list[int]] = {
        "width": 48,
        "message_passing_steps": 4,
        "radius_cells": 1.0,
        "past_velocities": 2,
        "frames_per_step": 3,
        "cutoff": "smooth",
        "overburden": True,
        "grid_cell": 4.0,
        "steps": 22_000,
        "restart_at": [13_000],
        "optimizer": "muon",
        "learning_rate": 2e-3,
        "final_learning_rate": 0.0,
        "schedule": "cosine",
        "warmup_steps": 200,
        "noise": 0.01,
        "unroll": 4,
        "unroll_ramp": 0.7,
        "start_share": 0.3,
        "balance": 0.3,
        "mirror": True,
        "averaging": 0.999,
        "validate_every": 1_500,
        "validate_runs": 16,
        "checkpoint_every": 250,
    }
    return {"coarse": coarse}


class TrainSettings(Settings):
    """The network and how it learns; the defaults are the paper's."""

    width: int = Field(128, ge=1, description="of the network's latents and hidden layers")
    message_passing_steps: int = Field(10, ge=1, description="rounds of messages between points")
    radius_cells: float = Field(1.5, gt=0, description="connectivity radius, in cells")
    past_velocities: int = Field(5, ge=1, description="velocities that the network sees")
    frames_per_step: int = Field(
        1, ge=1, description="frames of the data that the model goes in one step"
    )
    cutoff: Literal["sharp", "smooth"] = Field(
        "sharp", description="messages end at the radius abruptly, or fade before it"
    )
    strength: Literal["log", "linear"] = Field(
        "log", description="how cohesion is given to the network"
    )
    overburden: bool = Field(
        False, description="points know how much soil lies above them, and its slope"
    )
    grid_cell: float = Field(
        0.0,
        ge=0,
        description="cell of a coarse grid in addition to the edges, in spacings; 0: none",
    )
    grid_rounds: int = Field(3, ge=1, description="rounds of convolutions on that grid")
    grid_everywhere: bool = Field(
        False, description="such a grid between all message-passing steps, not halfway alone"
    )
    symmetric: bool = Field(
        False,
        description="a step of a rollout is the mean of the answers for a scene and for its "
        "mirror image; needs `mirror`",
    )
    steps: int = Field(3_500_000, ge=1, description="steps of the optimiser")
    batch_size: int = Field(2, ge=1, description="windows in a step, of each process")
    optimizer: Literal["adam", "muon"] = Field(
        "adam",
        description="Adam for all weights, or Muon for the matrices inside the network and Adam "
        "for the others",
    )
    learning_rate: float = Field(1e-4, gt=0, description="of Adam, at the start")
    muon_learning_rate: float = Field(
        0.01, gt=0, description="of Muon, at the start; it then falls as that of Adam does"
    )
    final_learning_rate: float = Field(1e-6, ge=0, description="at the last step")
    schedule: Literal["exponential", "cosine", "constant"] = Field(
        "exponential", description="how the learning rate gets from the first to the last"
    )
    warmup_steps: int = Field(0, ge=0, description="steps in which it first rises from zero")
    restart_at: Steps = Field(
        default=[],
        description="steps after each of which it rises and falls once more, ascending: so a "
        "training that has ended is made longer; those beyond the last step do nothing",
    )
    restart_share: float = Field(
        0.5, gt=0, description="of the first rates, from which it then falls"
    )
    gradient_clip: float = Field(
        1.0, ge=0, description="the gradient is shortened to this norm; 0: never"
    )
    noise: float = Field(
        0.0214,
        ge=0,
        description="standard deviation of the noise in the last velocity, sqrt(g d); the "
        "paper's 0.067 m/s at 1 m",
    )
    noise_target: Literal["position", "velocity"] = Field(
        "position", description="what the target sets right in one step: position or velocity"
    )
    pushforward: int = Field(
        0, ge=0, description="up to this many steps of the model itself before the one it learns"
    )
    unroll: int = Field(
        1, ge=1, description="steps of the model in a row through which the loss is differentiated"
    )
    unroll_ramp: float = Field(
        0.0, ge=0, le=1, description="share of the training in which these grow from one"
    )
    start_share: float = Field(
        0.0, ge=0, le=1, description="share of the windows that are moved to the start of their run"
    )
    balance: float = Field(
        0.0,
        ge=0,
        description="each window's loss is divided by the mean square of its run's accelerations "
        "plus this, in units of the training's variance; 0: not",
    )
    mirror: bool = Field(False, description="show every second window in the mirror")
    averaging: float = Field(
        0.0, ge=0, lt=1, description="weights are averaged over steps with this memory; 0: not"
    )
    precision: Literal["float32", "bfloat16"] = Field(
        "float32", description="of the work on edges; bfloat16 is mixed precision, for a GPU"
    )
    validate_every: int = Field(10_000, ge=1, description="steps between held-out rollouts")
    validate_runs: int = Field(10, ge=1, description="runs that are rolled out")
    checkpoint_every: int = Field(1_000, ge=1, description="steps between states on the disk")
    seed: int = Field(0, ge=0, description="decides the first weights, the order and the noise")

    @model_validator(mode="after")
    def _has_what_it_needs(self) -> TrainSettings:
        if self.symmetric and not self.mirror:
            raise ValueError("symmetric: true needs mirror: true, or the model knows one side only")
        if self.grid_everywhere and self.grid_cell == 0.0:
            raise ValueError("grid_everywhere: true needs a grid_cell above 0")
        return self


class GnsSettings(Settings):
    """The learned simulator."""

    pack: PackSettings = Field(
        default_factory=PackSettings, description="from trajectories to what a training reads"
    )
    train: TrainSettings = Field(
        default_factory=TrainSettings, description="the network and how it learns"
    )
    train_of_scale: dict[str, dict[str, int | float | bool | str | list[int]]] = Field(
        default_factory=_default_training, description="what of it differs for a scale, by name"
    )

    @model_validator(mode="after")
    def _differences_fit(self) -> GnsSettings:
        for scale, changes in self.train_of_scale.items():
            try:
                TrainSettings.model_validate({**self.train.model_dump(), **changes})
            except ValidationError as error:
                raise ValueError(
                    f"train_of_scale.{scale}.{describe_error(error, TrainSettings)}"
                ) from None
        return self


class Turns(Settings):
    """What the random scenes from a number on are."""

    first: int = Field(0, ge=0, description="number of the first of these scenes")
    families: list[Family] = Field(
        min_length=1,
        description="in turn, until the next entry: template (a to e by their weights), "
        "embankment_dam, hydraulic_fill_dam, and, with ground that goes on, "
        "embankment_on_foundation and impoundment",
    )


class ScaleSettings(Settings):
    """One family of random scenes and its simulations (paper, Table 1)."""

    number_of_scenes: int = Field(gt=0, le=99_999, description="scenes to draw and simulate")
    spacing_m: float = Field(gt=0, description="distance between material points, m")
    scale_factor: float = Field(gt=0, description="size of the templates; 1: Table A.1 as it is")
    domain_width_m: float = Field(gt=0, description="distance between the side walls, m")
    domain_height_m: float = Field(gt=0, description="height of the domain, m")
    material_ranges: Literal["large", "small", "any"] = Field(
        description="which column of the paper's Table 1 the strengths come from; any: drawn for "
        "a model that is to serve every spacing"
    )
    enlarged_share: float = Field(
        0.0, ge=0, le=1, description="share of the scenes that are enlarged, domain and all"
    )
    enlarged_by: float = Field(1.7, ge=1, description="at most by this factor")
    duration_s: float = Field(gt=0, description="motion that is simulated, s")
    time_step_s: float | None = Field(
        None, gt=0, description="fixed time step, s; null: simulation.time_step_s"
    )
    water: Literal["buoyant", "pore_pressure"] = Field(
        "buoyant",
        description="as simulation.water; the paper's runs are without the thrust of water",
    )
    dams_from: int | None = Field(
        None,
        ge=0,
        description="scenes from this number on are free-standing dams, most with a pool; "
        "null: none",
    )
    mixed_from: int | None = Field(
        None,
        ge=0,
        description="scenes from this number on are templates and dams in turn, every fourth a dam "
        "of hydraulic fill; null: none",
    )
    turns: list[Turns] = Field(
        default_factory=list,
        description="families of the scenes from a number on; they win over dams_from and "
        "mixed_from",
    )
    runs_per_batch: int = Field(100, gt=0, description="runs simulated by one job")

    @model_serializer(mode="wrap")
    def _written(self, write: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """No turns are not written: keys of what was made without stay as they were."""
        document = write(self)
        if not self.turns:
            document.pop("turns", None)
        return document

    @model_validator(mode="after")
    def _turns_ascend(self) -> ScaleSettings:
        first = [one.first for one in self.turns]
        if first != sorted(set(first)):
            raise ValueError(f"turns: first must ascend, but is {first}")
        return self

    @property
    def number_of_batches(self) -> int:
        """Jobs needed for all scenes of this scale."""
        return -(-self.number_of_scenes // self.runs_per_batch)

    def batch_indices(self, batch: int) -> range:
        """Indices of the scenes of one batch; an `InputError` if there is no such batch."""
        if not 0 <= batch < self.number_of_batches:
            raise InputError(f"batch {batch}: allowed are 0 to {self.number_of_batches - 1}")
        start = batch * self.runs_per_batch
        return range(start, min(start + self.runs_per_batch, self.number_of_scenes))


def _default_scales() -> dict[str, ScaleSettings]:
    large = ScaleSettings(
        number_of_scenes=2500,
        spacing_m=1.0,
        scale_factor=1.0,
        domain_width_m=240.0,
        domain_height_m=60.0,
        material_ranges="large",
        duration_s=40.0,
    )
    small = ScaleSettings(
        number_of_scenes=2500,
        spacing_m=0.25,
        scale_factor=0.25,
        domain_width_m=60.0,
        domain_height_m=15.0,
        material_ranges="small",
        duration_s=20.0,
    )
    coarse = large.model_copy(
        update={
            "number_of_scenes": 700,
            "spacing_m": 2.0,
            "material_ranges": "any",
            "enlarged_share": 0.2,
        }
    )
    return {"large": large, "small": small, "coarse": coarse}


class Config(Settings):
    """All settings. `flowslide schema` prints the JSON schema."""

    results_folder: str = Field(
        "results", min_length=1, description="where the workflow puts everything it makes"
    )
    scales: dict[Annotated[str, Field(pattern=r"^[a-z][a-z0-9]*$")], ScaleSettings] = Field(
        default_factory=_default_scales, description="the families of random scenes, by name"
    )
    geometry: GeometrySettings = Field(
        default_factory=GeometrySettings, description="how random scenes are drawn"
    )
    simulation: SimulationSettings = Field(
        default_factory=SimulationSettings, description="how scenes are simulated"
    )
    inversion: InversionSettings = Field(
        default_factory=InversionSettings, description="how strengths are found from measurements"
    )
    posterior: PosteriorSettings = Field(
        default_factory=PosteriorSettings, description="how the whole posterior is found"
    )
    gns: GnsSettings = Field(default_factory=GnsSettings, description="the learned simulator")
    joint: JointSettings = Field(
        default_factory=JointSettings, description="over which slides one relation is found"
    )
    diagnosis: DiagnosisSettings = Field(
        default_factory=DiagnosisSettings, description="how missing physics is searched for"
    )
    hidden_effects: HiddenEffectsSettings = Field(
        default_factory=HiddenEffectsSettings, description="the blind benchmark of the diagnosis"
    )

    @model_validator(mode="after")
    def _scales_exist(self) -> Config:
        for name in self.gns.train_of_scale:
            if name not in self.scales:
                raise ValueError(
                    f"gns.train_of_scale.{name}: no such scale; there are {', '.join(self.scales)}"
                )
        return self

    def scale(self, name: str) -> ScaleSettings:
        """The scale called `name`; an `InputError` naming the known ones if there is none."""
        if name not in self.scales:
            raise InputError(f"scale {name!r} is unknown: allowed are {', '.join(self.scales)}")
        return self.scales[name]

    def simulation_for(self, scale: str) -> SimulationSettings:
        """The simulation settings with the scale's own duration, time step and water put in."""
        own = self.scale(scale)
        update: dict[str, float | str] = {"duration_s": own.duration_s, "water": own.water}
        if own.time_step_s is not None:
            update["time_step_s"] = own.time_step_s
        return self.simulation.model_copy(update=update)

    def training_for(self, scale: str) -> TrainSettings:
        """The training settings with what differs for a scale put in; "" for none."""
        changes = self.gns.train_of_scale.get(scale, {})
        return TrainSettings.model_validate({**self.gns.train.model_dump(), **changes})


def load_config(path: str | os.PathLike[str] | None, overrides: Sequence[str] = ()) -> Config:
    """Read, complete and check a configuration.

    Args:
        path: YAML file with what differs from the defaults; None: the defaults.
        overrides: "key=value" with dotted keys and YAML values, as from `--set`; they win.

    Raises:
        InputError: one line with the file, the field, its value and what is allowed.

    Examples:
        >>> load_config(None, ["simulation.duration_s=30"]).simulation.duration_s
        30.0
    """
    values = Config().model_dump(mode="json")
    origin = "--set"
    if path is not None:
        origin = str(path)
        given = read_yaml(path)
        if given is not None and not isinstance(given, dict):
            raise InputError(f"{path}: must hold settings (key: value)")
        _merge(values, given or {})
        validate_settings(Config, values, origin=origin)  # so that an error names the right source
    for override in overrides:
        _merge(values, parse_override(override))
    return validate_settings(Config, values, origin="--set" if overrides else origin)


def parse_override(text: str) -> dict[str, Any]:
    """Turn "simulation.courant=0.2" into {"simulation": {"courant": 0.2}}."""
    key, separator, value = text.partition("=")
    parts = key.strip().split(".")
    if not separator or not all(parts):
        raise InputError(f"--set {text}: must be KEY=VALUE, for instance simulation.courant=0.2")
    result: Any = parse_yaml(value, name=f"--set {key.strip()}")
    for part in reversed(parts):
        result = {part: result}
    return result


def validate_settings(model: type[Model], values: Any, *, origin: str) -> Model:
    """Check `values` against a pydantic model; the first error becomes a one-line `InputError`."""
    try:
        return model.model_validate(values)
    except ValidationError as error:
        raise InputError(f"{origin}: {describe_error(error, model)}") from None


def load_document(model: type[Model], path: str | Path, name: str) -> Model:
    """Read a JSON document of a model from its file, or from the folder that has it under `name`.

    Raises:
        InputError: no such file, not JSON, or not of this schema; one line.
    """
    path = file_or_within(path, name)
    return validate_settings(model, read_json(path), origin=str(path))


def describe_error(error: ValidationError, model: type[BaseModel] | None = None) -> str:
    """The first problem of a pydantic error in one line: field, value, what is allowed."""
    problems = error.errors(include_url=False)
    first = problems[0]
    field = ".".join(str(part) for part in first["loc"] if part != "[key]") or "the whole"
    if first["type"] == "extra_forbidden":
        text = f"{field}: no such setting{_suggestion(first['loc'], model)}"
    elif first["type"] == "missing":
        text = f"{field}: is missing"
    else:
        message = first["msg"].removeprefix("Value error, ")
        value = "" if isinstance(first["input"], Mapping) else f" {_short(first['input'])}:"
        text = f"{field}:{value} {message[:1].lower()}{message[1:]}"
    return text if len(problems) == 1 else f"{text} (and {len(problems) - 1} more)"


def config_schema() -> dict[str, Any]:
    """The JSON schema of the configuration."""
    schema = Config.model_json_schema()
    schema["title"] = "flowslide configuration"
    # A file states only what differs from the defaults, so an editor must not ask for all the
    # fields of a scale. load_config does ask for them where a new scale is named.
    for definition in schema["$defs"].values():
        definition.pop("required", None)
    return schema


def schema_text() -> str:
    """The schema as the text of its file."""
    return schema_file_text(config_schema())


def config_hash(model: BaseModel) -> str:
    """16 hexadecimal digits; the place of the results is not part of what was computed."""
    values = model.model_dump(mode="json")
    if isinstance(model, Config):
        del values["results_folder"]
    return content_hash(values)


def _merge(values: dict[str, Any], changes: Mapping[str, Any]) -> None:
    """Lay `changes` over `values`, in place; groups are merged, everything else replaced."""
    for key, change in changes.items():
        if isinstance(change, Mapping) and isinstance(values.get(key), dict):
            _merge(values[key], change)
        else:
            values[key] = change


def _suggestion(location: tuple[int | str, ...], model: type[BaseModel] | None) -> str:
    """Name the setting that was probably meant, or those that exist."""
    known = _fields_at(location[:-1], model)
    if not known:
        return ""
    close = difflib.get_close_matches(str(location[-1]), known, n=1)
    return f", did you mean {close[0]}?" if close else f"; allowed are {', '.join(known)}"


def _fields_at(location: tuple[int | str, ...], model: Any) -> list[str]:
    for part in location:
        if not (isinstance(model, type) and issubclass(model, BaseModel)):
            # The value type of dict[str, Model]: the last model among the annotation's arguments.
            arguments = getattr(model, "__args__", ())
            model = arguments[-1] if arguments else None
            continue
        field = model.model_fields.get(str(part))
        model = field.annotation if field else None
    if isinstance(model, type) and issubclass(model, BaseModel):
        return list(model.model_fields)
    return []


def _short(value: Any, length: int = 60) -> str:
    text = repr(value)
    return text if len(text) <= length else text[: length - 3] + "..."
