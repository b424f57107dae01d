"""The two sections of a slide, from a case folder and an analyst's judgement.

In: `scene.yaml`, `measurements.yaml`, profiles, slip surfaces, perhaps a simulated deposit. Out: a
`MorphedSlide`, checked, and where its parts come from.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from geometry.case import SCENE_FILE, Case
from geometry.scenes.scene import Scene
from geometry.sides import Side
from geometry.survey.profiles import load_profile
from geometry.survey.surface_profile import surface_profile
from inversion.classical.judgement import SEARCH, Judgement
from inversion.classical.morph import MorphedSlide
from inversion.classical.search import critical_polyline
from inversion.classical.section import ClassicalSection, section_of
from inversion.classical.slices import Polyline
from pipeline.cli import InputError, WorkFailed

#: A surface that sank by less than this share of the section's height has not moved.
UNMOVED = 0.01


@dataclass(frozen=True)
class SurfaceAfter:
    """The surface after the slide.

    Attributes:
        points: (P, 2) [m], x ascending.
        kind: `measured`, `constructed` or `simulated`.
        source: file it was read from.
    """

    points: np.ndarray
    kind: str
    source: str


@dataclass(frozen=True)
class CaseSections(Case):
    """A case as the classical methods see it.

    Attributes:
        simulated: a deposit that replaces the surveyed profile; None: the profile counts.
    """

    simulated: SurfaceAfter | None = None

    def after(self, judgement: Judgement) -> SurfaceAfter:
        """The surface after the slide that a judgement asks for.

        Raises:
            InputError: there is none.
        """
        if self.simulated is not None:
            return self.simulated
        confidence = "constructed"
        if judgement.profile is not None:
            name = judgement.profile
            for entry in self.measurements.profiles:
                if entry.file == name:
                    confidence = entry.confidence
        elif self.measurements.profiles:
            entry = self.measurements.profiles[0]
            name, confidence = entry.file, entry.confidence
        else:
            raise InputError(
                f"{self.folder}: no surface after the slide: measurements.yaml has no "
                "surface_profile, and classical.yaml names no profile"
            )
        profile = load_profile(self.folder / name)
        kind = "constructed" if confidence == "constructed" else "measured"
        return SurfaceAfter(np.column_stack([profile.x, profile.y]), kind, name)

    def section(self, judgement: Judgement, head: float | None = None) -> ClassicalSection:
        """The section before the slide, with the water a judgement asks for.

        Args:
            judgement: asks for no water, for the line as drawn, or for still water at pool level.
            head: upper end of the mass [m]; still water reaches that far, and beyond it the line
                is as drawn. None: it reaches everywhere.
        """
        section = section_of(
            self.scene,
            water=judgement.water != "none",
            unit_weight_factor=judgement.unit_weight_factor,
        )
        if section.water is None or judgement.water_line == "phreatic":
            return section
        assert self.scene.water_level is not None
        level = self.scene.water_level
        if head is None or len(section.water) == 1:
            return replace(section, water=np.array([[self.scene.domain.x_min, level]]))
        drawn, left = section.water, judgement.side == "left"
        beyond = drawn[drawn[:, 0] > head] if left else drawn[drawn[:, 0] < head]
        outside = self.scene.domain.x_min if left else self.scene.domain.x_max
        # The step at the head is as steep as a line may be whose x ascends.
        edge = head + (1e-6 if left else -1e-6)
        step = [[head, level], [edge, float(section.water_level(edge))]]
        points = np.array([[min(outside, head) if left else max(outside, head), level], *step])
        points = np.concatenate([points, beyond])
        order = np.argsort(points[:, 0], kind="stable")
        return replace(section, water=points[order])

    def slip(self, judgement: Judgement) -> Polyline:
        """The slip surface that a judgement names, or the critical one of the section before.

        Raises:
            InputError: a file that cannot be read, or no slip surface that could be.
        """
        if judgement.slip_surface != SEARCH:
            profile = load_profile(self.folder / judgement.slip_surface)
            return Polyline(np.column_stack([profile.x, profile.y]))
        section, after = self.section(judgement), self.after(judgement)
        head = judgement.head_x_m
        if head is None:
            head = head_of(section, after.points, judgement.side)
        section = self.section(judgement, head)
        toe = section.extent[0 if judgement.side == "left" else 1]
        surface = Polyline(after.points)
        try:
            return critical_polyline(
                section,
                judgement.side,
                toe=toe,
                head=head,
                head_level=float(min(surface.level(head), section.surface(head))),
                foot_range=_foot_range(section, toe, head),
                not_above=surface,
            ).polyline
        except WorkFailed as problem:
            raise InputError(f"{self.folder}: {judgement.name}: slip surface: {problem}") from None

    def slide(self, judgement: Judgement, slip: Polyline) -> MorphedSlide:
        """The slide of one analysis on a slip surface, checked.

        Raises:
            InputError: sections or slip surface that cannot belong together.
        """
        head = slip.ends[1 if judgement.side == "left" else 0]
        section, after = self.section(judgement, head), self.after(judgement)
        slide = MorphedSlide(section, slip, after.points, judgement.side)
        try:
            slide.check()
        except InputError as problem:
            raise InputError(f"{self.folder}: {judgement.name}: {problem}") from None
        return slide


def case_sections(case: Case, *, run: str | Path | None = None) -> CaseSections:
    """A case as the classical methods see it, perhaps with a simulated surface after the slide.

    Args:
        case: with measurements.
        run: trajectory file whose first run ends with the deposit to take instead of the profile.

    Raises:
        InputError: something is missing or does not hold together; one line.
    """
    if not any(material.liquefied for material in case.scene.materials.values()):
        raise InputError(
            f"{case.folder / SCENE_FILE}: materials: none is `liquefied: true`: no S_r to find"
        )
    _ = case.measurements  # refused here where there are none
    simulated = None if run is None else simulated_surface(run, case.scene)
    return case.extended(CaseSections, simulated=simulated)


def simulated_surface(path: str | Path, scene: Scene) -> SurfaceAfter:
    """The surface of the last frame of a trajectory file's first run.

    Raises:
        InputError: no such file, no run in it, or a run of another section.
    """
    from mpm_taichi.trajectory import list_runs, read_run  # h5py is not needed otherwise

    runs = list_runs(path)
    if not runs:
        raise InputError(f"{path}: holds no run")
    run = read_run(path, runs[0].index, ["positions", "initial_volume"])
    if run.scene.name != scene.name:
        raise InputError(f"{path}: holds a run of {run.scene.name!r}, not of {scene.name!r}")
    if not run.frames:
        raise InputError(f"{path}: its first run has no frames: {run.reason}")
    spacing = run.scene.spacing
    last = run.positions[-1].astype(float)
    x = np.arange(last[:, 0].min() - spacing, last[:, 0].max() + 1.5 * spacing, spacing)
    ground = np.asarray(scene.ground.points, dtype=float)
    y = surface_profile(last, run.initial_volume, x, spacing=spacing, ground=ground)
    return SurfaceAfter(np.column_stack([x, y]), "simulated", str(path))


def head_of(section: ClassicalSection, after: np.ndarray, side: Side) -> float:
    """Upper end of the mass that moved to one side [m].

    From the toe inwards, the place where the surface stops changing; where all of it changed,
    the middle of the crest, for the other half then went to the other side.
    """
    left, right = section.extent
    x = np.linspace(left, right, 2001)
    before = section.surface(x)
    surveyed = (x >= after[0, 0]) & (x <= after[-1, 0])
    now = np.where(surveyed, np.interp(x, after[:, 0], after[:, 1]), before)
    height = float(np.ptp(before))
    moved = np.abs(now - before) > UNMOVED * height
    if side == "right":
        x, before, moved = x[::-1], before[::-1], moved[::-1]
    crest = x[before > before.max() - 1e-6 * height]
    middle = float(0.5 * (crest[0] + crest[-1]))
    # The new surface crosses the old one where the slope steepened; that is not an end of the mass.
    still = np.flatnonzero(~moved & (np.cumsum(moved) > 0))
    beyond = [k for k in still if not moved[k : k + len(x) // 20].any()]
    if not beyond:
        return middle
    return float(x[beyond[0]])


def _foot_range(section: ClassicalSection, toe: float, head: float) -> tuple[float, float]:
    """Where a slip surface along the base may begin to rise [m]."""
    liquefied = np.concatenate(
        [
            polygon[:, 0]
            for polygon, soil in zip(section.polygons, section.soils, strict=True)
            if soil.liquefied
        ]
    )
    low, high = min(toe, head), max(toe, head)
    near = liquefied[(liquefied >= low) & (liquefied <= high)]
    if not len(near):
        raise InputError(f"no liquefied soil between x = {low:g} and {high:g} m")
    start = near.min() if toe < head else near.max()
    near_toe, near_head = float(start), head - 0.05 * (head - toe)
    return min(near_toe, near_head), max(near_toe, near_head)
