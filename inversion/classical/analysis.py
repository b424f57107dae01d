"""All classical methods on one slide, with the range over the judgement calls.

In: `CaseSections` and a `Judgement`. Out: `Analysis`: for each method S_r, the S_r under every
other judgement (one at a time), the range, histories; and the factors of safety of the sections.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from inversion.classical import imm, kinetics, zif
from inversion.classical.judgement import SEARCH, WATER_WORDS, Judgement
from inversion.classical.kinetics import Motion
from inversion.classical.limit_equilibrium import (
    Method,
    force_balance,
    ordinary,
    required_strength,
    spencer,
)
from inversion.classical.morph import MorphedSlide, Stage
from inversion.classical.search import FoundCircle, critical_circle
from inversion.classical.section import OUTSIDE
from inversion.classical.sections_of_case import CaseSections, SurfaceAfter
from inversion.classical.slices import Polyline, Slices, WaterForm
from inversion.classical.slide_forces import SlideForces, sum_forces
from pipeline.cli import InputError, WorkFailed

#: Share of a slip surface that must pass through liquefied soil.
LEAST_LIQUEFIED = 0.01
METHODS = {
    "kinetics": "Kinetics (Olson 2001)",
    "zif": "Zero inertial factor (Kramer and Wang 2015)",
    "imm": "Incremental momentum (Weber 2015)",
}


@dataclass(frozen=True)
class Option:
    """One judgement call that could have gone another way.

    Attributes:
        name: short, unique for a method.
        words: what is different.
        changes: fields of the judgement.
        methods: those it matters to.
        in_range: False for what is another question, or a known error shown for its size.
    """

    name: str
    words: str
    changes: dict[str, Any]
    methods: tuple[str, ...] = tuple(METHODS)
    in_range: bool = True


@dataclass(frozen=True)
class OptionAnswer:
    """Result of a method under an option; `strength` [Pa] is None where it has no answer."""

    option: Option
    strength: float | None
    reason: str = ""


@dataclass(frozen=True)
class MethodAnswer:
    """Result of a method, and its range.

    Attributes:
        method: key of `METHODS`.
        strength: S_r [Pa], or None.
        reason: why there is none.
        options: the other judgements.
        motion: history of the slide; None for ZIF.
        path: of the centre of gravity (K, 2) [m]; Kinetics only.
    """

    method: str
    strength: float | None
    reason: str = ""
    options: list[OptionAnswer] = field(default_factory=list)
    motion: Motion | None = None
    path: np.ndarray | None = None

    @property
    def range(self) -> tuple[float, float] | None:
        """Lowest and highest S_r [Pa] over the judgement calls; None without an answer."""
        found = [o.strength for o in self.options if o.option.in_range and o.strength is not None]
        if self.strength is None:
            return None
        return min([*found, self.strength]), max([*found, self.strength])


@dataclass(frozen=True)
class Stability:
    """How far one section is from standing.

    Attributes:
        share: of the displacement.
        factors: of safety by method, with the strengths of the scene; None without a solution.
        strengths: S_r [Pa] for FS = 1 by method; None without a solution.
    """

    share: float
    factors: dict[str, float | None]
    strengths: dict[str, float | None]


@dataclass(frozen=True)
class Analysis:
    """Everything about one slide."""

    judgement: Judgement
    slide: MorphedSlide
    after: SurfaceAfter
    answers: list[MethodAnswer]
    before: Stability
    final: Stability
    circle: FoundCircle | None
    stages: list[Stage]
    forces: list[SlideForces]
    zif_stage: Stage
    zif_slices: Slices

    def answer(self, method: str) -> MethodAnswer:
        """The answer of one method."""
        return next(answer for answer in self.answers if answer.method == method)


class Workbench:
    """Slip surfaces, slides and sections of one slide, each computed once.

    A slip surface that is searched is searched under the first judgement and kept: an option about
    water or weights changes that and nothing else.
    """

    def __init__(self, case: CaseSections, judgement: Judgement) -> None:
        self.case = case
        self.judgement = judgement
        self._slips: dict[str, Polyline] = {}
        self._slides: dict[tuple, MorphedSlide] = {}
        self._stages: dict[tuple[int, float], Stage] = {}
        self._slices: dict[tuple, Slices] = {}

    def slide(self, judgement: Judgement) -> MorphedSlide:
        """The slide of a judgement.

        Raises:
            InputError: as `CaseSections.slide`; or its slip surface passes no liquefied soil.
        """
        name = judgement.slip_surface
        if name not in self._slips:
            chosen = self.judgement.model_copy(update={"slip_surface": name})
            self._slips[name] = self.case.slip(chosen)
        key = (name, judgement.water == "none", judgement.water_line, judgement.unit_weight_factor)
        if key not in self._slides:
            slide = self.case.slide(judgement, self._slips[name])
            bases = slide.slices(slide.section(0.0), form="buoyant", base=judgement.base_strength)
            if bases.length[bases.liquefied].sum() < LEAST_LIQUEFIED * bases.length.sum():
                raise InputError(
                    f"{self.case.folder}: {judgement.name}: slip surface: passes through no "
                    "liquefied soil, so there is no S_r to find on it"
                )
            self._slides[key] = slide
        return self._slides[key]

    def stage(self, judgement: Judgement, share: float) -> Stage:
        """The section at a share of the displacement."""
        slide = self.slide(judgement)
        key = (id(slide), share)
        if key not in self._stages:
            self._stages[key] = slide.section(share)
        return self._stages[key]

    def slices(
        self, judgement: Judgement, share: float, *, buoyant: bool = False
    ) -> tuple[Slices, float]:
        """Slices at a share, and the factor on the strength of soil that did not liquefy."""
        pressed = judgement.water == "pore_pressure" and not buoyant
        form: WaterForm = "pore_pressure" if pressed else "buoyant"
        slide = self.slide(judgement)
        key = (id(slide), share, form, judgement.base_strength)
        if key not in self._slices:
            self._slices[key] = slide.slices(
                self.stage(judgement, share), form=form, base=judgement.base_strength
            )
        return self._slices[key], 1.0 if judgement.count_others else 0.0

    def forces(self, judgement: Judgement, share: float, *, buoyant: bool = False) -> SlideForces:
        """Sums over the slices at a share."""
        slices, others = self.slices(judgement, share, buoyant=buoyant)
        return sum_forces(slices, others=others)


def solve_kinetics(bench: Workbench, judgement: Judgement) -> MethodAnswer:
    """S_r by Kinetics. A rigid body has no pore pressure: its weight is less uplift, always."""
    before, after = (bench.forces(judgement, share, buoyant=True) for share in (0.0, 1.0))
    body = kinetics.body_of(
        before,
        after,
        -1 if judgement.side == "left" else 1,
        end_slope=judgement.path_end,
        stages=judgement.path_stages,
    )
    strength, motion = kinetics.find_strength(body, time_step=judgement.time_step_s)
    return MethodAnswer("kinetics", strength, motion=motion, path=body.path.points())


def solve_zif(bench: Workbench, judgement: Judgement) -> MethodAnswer:
    """S_r by the zero inertial factor."""
    slices, others = bench.slices(judgement, judgement.zif_share)
    return MethodAnswer("zif", zif.find_strength(slices, judgement.method, others=others))


def solve_imm(bench: Workbench, judgement: Judgement) -> MethodAnswer:
    """S_r by incremental momentum."""
    shares = np.linspace(0.0, 1.0, judgement.sections)
    forces = [bench.forces(judgement, float(share)) for share in shares]
    strength, motion = imm.find_strength(forces, shares.tolist())
    return MethodAnswer("imm", strength, motion=motion)


SOLVERS: dict[str, Callable[[Workbench, Judgement], MethodAnswer]] = {
    "kinetics": solve_kinetics,
    "zif": solve_zif,
    "imm": solve_imm,
}


def options_of(judgement: Judgement, *, has_water: bool) -> Iterator[Option]:
    """The judgement calls that are tried, one at a time."""
    more = judgement.alternatives
    if has_water and judgement.water != "none":
        yield from _water_options(judgement)
    for factor in more.unit_weight_factors:
        words = f"all unit weights {100 * (factor - 1):+.0f} %"
        changed = factor * judgement.unit_weight_factor
        yield Option(f"unit weight x {factor:g}", words, {"unit_weight_factor": changed})
    for base, words in {
        "weaker": "base: S_r where the ground or what came over it is liquefied",
        "place": "base: strength of the soil that lay there before",
        "carried": "base: strength of the soil that came there",
    }.items():
        if base != judgement.base_strength:
            yield Option(f"base strength: {base}", words, {"base_strength": base})
    if judgement.count_others:
        words = "strength of the soil that did not liquefy left out"
        yield Option("liquefied strength alone", words, {"count_others": False})
    for slip in more.slip_surfaces:
        if slip != judgement.slip_surface:
            words = "critical slip surface along the base" if slip == SEARCH else f"along {slip}"
            yield Option(f"slip surface: {slip}", words, {"slip_surface": slip})
    for share in sorted({*more.zif_shares} - {judgement.zif_share}):
        yield Option(f"f = {share:.2f}", f"f = {share:g}", {"zif_share": share}, ("zif",))
    for method, words in {
        "spencer": "Spencer's method",
        "force": "balance of forces alone, level between slices",
        "ordinary": "ordinary method of slices",
    }.items():
        if method != judgement.method:
            yield Option(f"method: {method}", words, {"method": method}, ("zif",))
    for number in sorted({*more.sections} - {judgement.sections}):
        yield Option(f"{number} sections", f"{number} sections", {"sections": number}, ("imm",))
    for end in ("slip", "level"):
        if end != judgement.path_end:
            words = "path ends level" if end == "level" else "path ends along the slip surface"
            yield Option(f"path end: {end}", words, {"path_end": end}, ("kinetics",))
    for stages, words in {
        "varying": "weight, length and resistance going from before to after",
        "before": "weight, length and resistance of the section before",
        "after": "weight, length and resistance of the section after",
    }.items():
        if stages != judgement.path_stages:
            yield Option(f"forces: {stages}", words, {"path_stages": stages}, ("kinetics",))


def _water_options(judgement: Judgement) -> Iterator[Option]:
    static = ("zif", "imm")
    other = "pore_pressure" if judgement.water == "buoyant" else "buoyant"
    line = "still water at pool level" if judgement.water_line == "level" else "phreatic line"
    yield Option(f"water: {other}", f"{WATER_WORDS[other]}, {line}", {"water": other}, static)
    if judgement.water_line == "level":
        words = f"{WATER_WORDS['pore_pressure']}, water table as drawn, seepage and thrust included"
        changes = {"water": "pore_pressure", "water_line": "phreatic"}
        yield Option("water: pore_pressure, phreatic line", words, changes, static)
        words = f"{WATER_WORDS['buoyant']}, water table as drawn (no seepage, no thrust)"
        changes = {"water": "buoyant", "water_line": "phreatic"}
        yield Option("water: buoyant, phreatic line", words, changes, ("kinetics",))
        words += ": inconsistent where the water table falls, shown for its size"
        yield Option("water: buoyant, phreatic line", words, changes, static, in_range=False)
    yield Option("no water", "without any water", {"water": "none"}, in_range=False)


def analyse(case: CaseSections, judgement: Judgement) -> Analysis:
    """Run every method on one slide, with all its judgement calls.

    Raises:
        InputError: sections or slip surface that cannot belong together.
    """
    bench = Workbench(case, judgement)
    slide = bench.slide(judgement)
    has_water = case.scene.has_water
    answers = [_with_options(bench, judgement, method, has_water=has_water) for method in METHODS]
    shares = np.linspace(0.0, 1.0, judgement.sections)
    return Analysis(
        judgement=judgement,
        slide=slide,
        after=case.after(judgement),
        answers=answers,
        before=_stability(bench, judgement, 0.0),
        final=_stability(bench, judgement, 1.0),
        circle=_circle(slide, judgement),
        stages=[bench.stage(judgement, float(share)) for share in shares],
        forces=[bench.forces(judgement, float(share)) for share in shares],
        zif_stage=bench.stage(judgement, judgement.zif_share),
        zif_slices=bench.slices(judgement, judgement.zif_share)[0],
    )


def _with_options(
    bench: Workbench, judgement: Judgement, method: str, *, has_water: bool
) -> MethodAnswer:
    """A method's answer with all options that concern it."""
    try:
        base = SOLVERS[method](bench, judgement)
    except WorkFailed as problem:
        base = MethodAnswer(method, None, str(problem))
    options = list(options_of(judgement, has_water=has_water))
    if method == "zif":
        options += _share_of_imm(bench, judgement)
    answers = []
    for option in options:
        if method not in option.methods:
            continue
        changed = judgement.model_copy(update=option.changes)
        try:
            answers.append(OptionAnswer(option, SOLVERS[method](bench, changed).strength))
        except (InputError, WorkFailed, ValueError) as problem:
            answers.append(OptionAnswer(option, None, str(problem)))
    return MethodAnswer(method, base.strength, base.reason, answers, base.motion, base.path)


def _share_of_imm(bench: Workbench, judgement: Judgement) -> list[Option]:
    """The option of taking f from IMM, if it has an answer."""
    try:
        motion = solve_imm(bench, judgement).motion
    except WorkFailed:
        return []
    if motion is None or not math.isfinite(share := motion.zero_inertia_share):
        return []
    words = f"f = {share:.3f}, where the forces of IMM balance"
    return [Option("f of IMM", words, {"zif_share": round(share, 6)}, ("zif",))]


def _stability(bench: Workbench, judgement: Judgement, share: float) -> Stability:
    slices, others = bench.slices(judgement, share)
    scene = _scene_strengths(slices, others)
    factors: dict[Method, float] = {
        "ordinary": float(ordinary(scene)),
        "force": float(force_balance(scene)),
        "spencer": float(spencer(scene)),
    }
    strengths: dict[Method, float] = {
        method: float(required_strength(slices, method, others=others)) for method in factors
    }
    return Stability(share, _known(factors), _known(strengths))


def _scene_strengths(slices: Slices, others: float) -> Slices:
    """Slices with every S_r of the scene; on ground that was overrun the mean of the others."""
    inside = slices.liquefied & (slices.zone != OUTSIDE)
    cohesion = slices.cohesion
    if inside.any():
        mean = np.average(cohesion[inside], weights=slices.length[inside])
        cohesion = np.where(slices.liquefied & ~inside, mean, cohesion)
    held = np.where(slices.liquefied, 1.0, others)
    return replace(slices, cohesion=held * cohesion, friction=others * slices.friction)


def _known(values: Mapping[Method, float]) -> dict[str, float | None]:
    return {name: value if math.isfinite(value) else None for name, value in values.items()}


def _circle(slide: MorphedSlide, judgement: Judgement) -> FoundCircle | None:
    """The critical circle of the section before, between the same parts of the surface."""
    toe, head = slide.toe_before, slide.head
    middle, end = toe + 0.5 * (head - toe), toe + 0.45 * (head - toe)
    begin = toe - 0.02 * (head - toe)
    upper = (min(middle, head), max(middle, head))
    left, right = slide.before.extent
    lower = (max(min(begin, end), left), min(max(begin, end), right))
    form: WaterForm = "pore_pressure" if judgement.water == "pore_pressure" else "buoyant"
    try:
        return critical_circle(slide.before, judgement.side, head=upper, toe=lower, form=form)
    except WorkFailed:
        return None
