"""A case folder for a slide that nobody drew, from the few numbers that are known of it.

In: `dimensions.yaml`. Out: a folder with that file and what is taken where it is silent, the
section with every dimension at its median, the measurements and the question, in which every
dimension is unknown.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from geometry.dimensions.family import Dimension, SectionFamily
from geometry.dimensions.median_section import median_section
from geometry.dimensions.stated import FILE_NAME, StatedNumber, load_dimensions
from geometry.scenes.scene import Scene
from geometry.sides import Side
from inversion.new_case.case_files import CaseWords, inversion_text, scene_file_text
from inversion.new_case.make_case import new_folder, write_case
from pipeline.files import read_text, yaml_text
from pipeline.units import with_signs

TOE, DURATION, SLOPE = "toe", "duration", "final slope"
#: Line before the comments that end a case's file of dimensions.
TAKEN = "# Not stated above, so drawn from (all values in a range alike; H: heights):"
#: How far a number may be trusted, as measurements have it.
CONFIDENCE = {
    "read": "published",
    "abstract": "published",
    "paper": "paper",
    "secondary": "secondary",
    "recalled": "recalled",
}


#: What a slide without a pool leaves open.
DRY = (
    "slid_face dry: sigma'_v0 has no pore pressure in it, though what liquefied was saturated; "
    "S_r/sigma'_v0 is too low by its share"
)


@dataclass(frozen=True)
class CaseOfDimensions:
    """A case folder that was written.

    Attributes:
        folder: of the case.
        scene: its median section.
        dimensions: all of them, stated or not.
        runouts: measured [m].
        doubts: on what is stated, in lines.
    """

    folder: Path
    scene: Scene
    dimensions: tuple[Dimension, ...]
    runouts: list[float]
    doubts: list[str]


def case_of_dimensions(name: str, file: str, spacing_m: float | None = None) -> CaseOfDimensions:
    """Make the folder of a case, checked as a back-analysis would.

    Args:
        name: of the case, made in `case_histories` here; with a slash in it the folder itself.
        file: with what is stated.
        spacing_m: of material points; None: by the height and what liquefied.

    Raises:
        InputError: one line: what is missing or wrong; nothing is written then.
    """
    folder = new_folder(name)
    stated = load_dimensions(Path(file))
    family = SectionFamily(stated)
    scene = median_section(family, folder.name, spacing_m)
    upstream: Side = "right" if stated.slid_face == "downstream" else "left"
    words = CaseWords(folder.name, FILE_NAME, upstream, None, sourced=True)
    write_case(
        folder,
        {
            FILE_NAME: _stated_text(file) + _taken_text(family),
            "scene.yaml": scene_file_text(scene, words),
            "measurements.yaml": _measurements_text(family, scene, words),
            "inversion.yaml": inversion_text(scene, [], family.dimensions),
            "README.md": _readme_text(family, words),
        },
    )
    runouts = [] if stated.runout_m is None else [stated.runout_m.middle]
    doubts = [*stated.doubts(), *family.doubts()]
    if stated.slid_face == "dry":
        doubts.append(DRY)
    return CaseOfDimensions(folder, scene, family.dimensions, runouts, doubts)


def distribution_words(one: Dimension) -> str:
    """A dimension's distribution in words."""
    if one.normal is None:
        return f"{one.low:.4g} to {one.high:.4g} {with_signs(one.unit)}"
    median, std = one.normal
    return f"{median:.4g} ± {median * std:.2g} {with_signs(one.unit)}"


def _stated_text(file: str) -> str:
    """What a file states, without the comments that an earlier case has ended it with."""
    return read_text(file).partition(TAKEN)[0].rstrip("\n") + "\n"


def _taken_text(family: SectionFamily) -> str:
    """What a case takes where its file is silent, as comments that end the file."""
    silent = [one for one in family.dimensions if not one.stated]
    lines = [f"#   {one.label}: {distribution_words(one)} ({one.source})" for one in silent]
    return "\n".join([TAKEN, *lines, ""]) if silent else ""


def _measurements_text(family: SectionFamily, scene: Scene, words: CaseWords) -> str:
    stated = family.stated
    entries: list[dict[str, Any]] = []
    if stated.runout_m is not None:
        toe = {"name": TOE, "type": "toe_runout", "side": "left"}
        entries.append({**toe, **_numbers(stated.runout_m, "m", scene.spacing)})
    if stated.duration_s is not None:
        time = {"name": DURATION, "type": "slide_duration"}
        entries.append({**time, **_numbers(stated.duration_s, "s", 0.0)})
    if stated.final_slope_h_per_v is not None:
        slope = {"name": SLOPE, "type": "final_slope", "side": "left"}
        entries.append({**slope, **_inclination(stated.final_slope_h_per_v)})
    document: Mapping[str, Any] = {
        "case": words.name,
        "upstream": words.upstream,
        "initial": {"toe_left_x_m": 0.0},
        "default_set": "stated",
        "sets": {"stated": entries},
    }
    head = "# What was measured after the slide, from dimensions.yaml. Keys: "
    return f"{head}docs/method/measurements.md.\n" + yaml_text(document, width=100)


def _numbers(stated: StatedNumber, unit: str, least_std: float) -> dict[str, Any]:
    """Value, standard deviation (at least a spacing, to which a toe is read) and where from."""
    return {
        f"value_{unit}": stated.middle,
        f"std_{unit}": _rounded(max(stated.deviation, least_std)),
        "std_is": "published" if stated.std_is_stated else "assumed",
        "confidence": CONFIDENCE[stated.how],
        "source": stated.source or FILE_NAME,
    }


def _inclination(stated: StatedNumber) -> dict[str, Any]:
    """The same of a slope that is stated as horizontal per vertical, in degrees."""
    flat = stated.middle
    value, std = math.atan(1.0 / flat), stated.deviation / (1.0 + flat**2)
    if stated.value is None:
        # Over a range the inclination bends: mean and deviation of all slopes in it.
        all_alike = np.linspace(*stated.ends, 2001)
        inclinations = np.arctan(1.0 / all_alike)
        value, std = float(inclinations.mean()), float(inclinations.std())
    numbers = _numbers(stated, "deg", 0.0)
    degrees = {"value_deg": round(math.degrees(value), 3), "std_deg": _rounded(math.degrees(std))}
    return {**numbers, **degrees}


def _rounded(std: float) -> float:
    """To four decimals, of small ones to three figures: never 0."""
    return round(std, 4) if std > 0.05 else float(f"{std:.3g}")


def _readme_text(family: SectionFamily, words: CaseWords) -> str:
    rows = "\n".join(
        f"| {one.label} | {distribution_words(one)} | {one.source} |" for one in family.dimensions
    )
    return f"""# {words.title}

Known by a few numbers (`{FILE_NAME}`); nobody drew its section. Every dimension below is an unknown
of `flowslide posterior`. Axes: x = 0 at the foot of the slid face, which looks left; y = 0 at the
base.

| dimension | distribution | how it is known |
|---|---|---|
{rows}

`scene.yaml` is the section with every dimension at its median. Whoever changes a number makes the
case again: `flowslide new NAME --dimensions {FILE_NAME}`.
"""
