"""A folder for a dam of your own, from a drawn section and a survey.

In: a section (CSV, GeoJSON, DXF) and, where it has slid, a measured runout or a surveyed profile.
Out: a commented folder with `scene.yaml`, `README.md` and, of a slide, `measurements.yaml`,
`inversion.yaml` and the profile, which can be checked and simulated or inverted as it is. What is
assumed says so and waits to be replaced.

Nothing is made up that decides the answer: a zone without strength, a survey without a runout and a
slide without a liquefied zone are refused.
"""

from __future__ import annotations

import os
import re
import shutil
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from geometry.case import load_case
from geometry.scenes.drawings import (
    DrawnSection,
    read_materials,
    read_section,
    reading,
    section_scene,
)
from geometry.scenes.scene import Scene, scene_from_mapping
from geometry.sides import SIDES, Side
from geometry.survey.profiles import Profile, load_profile
from inversion.back_analysis.case import inversion_case
from inversion.new_case.case_files import (
    PROFILE_FILE,
    CaseWords,
    Runout,
    inversion_text,
    measurements_text,
    profile_text,
    readme_text,
    scene_file_text,
    toe_name,
)
from pipeline.cli import InputError
from pipeline.config import load_config
from pipeline.files import make_folder

CASES = Path("case_histories")
NAME = re.compile(r"[a-z][a-z0-9_]*")
#: A runout whose uncertainty is not given is taken to be known to this share, and to one spacing.
ASSUMED_SHARE = 0.1


@dataclass(frozen=True)
class Given:
    """Known facts of a new case.

    Attributes:
        section: file of the drawn section.
        format: of the section: csv, geojson or dxf; None: from its suffix.
        materials: YAML file with the fields of each material.
        unit: of the drawing; None: its own, or m.
        snap: vertices closer than this are joined [m].
        spacing_m: of material points; None: height / 25, rounded.
        liquefied: zones whose S_r is unknown, in addition to those that the drawing marks.
        water_level: pool or water table, y [m]; None: none, or the drawing's.
        runouts: measured runouts of the toe, such as "left=53" or "left=53+-6".
        profile: CSV file of the surveyed surface (x_m, y_m).
        profile_std_m: standard deviation of the survey [m].
        upstream: "left" or "right".
        ends: side -> "far" (the ground goes on) or "free"; absent: by the outline.
    """

    section: str
    format: str | None = None
    materials: str | None = None
    unit: str | None = None
    snap: float = 0.0
    spacing_m: float | None = None
    liquefied: Sequence[str] = ()
    water_level: float | None = None
    runouts: Sequence[str] = ()
    profile: str | None = None
    profile_std_m: float = 0.5
    upstream: Side = "left"
    ends: Mapping[str, str] = field(default_factory=dict)

    @property
    def has_slid(self) -> bool:
        """Something was measured after a slide."""
        return bool(self.runouts) or self.profile is not None


@dataclass(frozen=True)
class NewCase:
    """A case folder that was written.

    Attributes:
        folder: of the case.
        scene: its section.
        runouts: measured or read from the profile.
        read: what was read of the drawing, and what was left out, in lines.
    """

    folder: Path
    scene: Scene
    runouts: list[Runout]
    read: list[str]


def make_case(name: str, given: Given) -> NewCase:
    """Make the folder of a case, checked as a back-analysis would.

    Args:
        name: of the case, made in `case_histories` here; with a slash in it the folder itself.
        given: what is known of it.

    Raises:
        InputError: one line: what is missing or wrong; nothing is written then.
    """
    folder = new_folder(name)
    section = read_section(given.section, given.format)
    scene = _scene(section, given, folder.name)
    profile = None if given.profile is None else load_profile(given.profile)
    if not given.profile_std_m > 0:
        raise InputError(f"--profile-std {given.profile_std_m:g}: must be greater than 0")
    runouts = _runouts(given.runouts, profile, scene)
    scene = _with_room(scene, runouts, profile)
    words = CaseWords(
        folder.name,
        Path(given.section).name,
        given.upstream,
        None if profile is None else given.profile_std_m,
    )
    _write(folder, scene, runouts, profile, words)
    return NewCase(folder, scene, runouts, reading(section, given.unit))


def new_folder(text: str) -> Path:
    """The folder to make; refused where it is there already or could be no target of snakemake."""
    folder = CASES / text if os.sep not in text else Path(text)
    if not NAME.fullmatch(folder.name):
        raise InputError(
            f"CASE {folder.name!r}: a name has small letters, digits and _ and begins with a letter"
        )
    taken = [*load_config(None).scales, "lsfd"]
    if folder.name in taken:
        raise InputError(f"CASE {folder.name!r}: is taken; so are {', '.join(taken)}")
    if folder.exists():
        raise InputError(f"{folder}: exists already; nothing is overwritten, take another name")
    return folder


# --- the section ---


def _scene(section: DrawnSection, given: Given, name: str) -> Scene:
    """The section as a scene, with its liquefied zones marked and its water."""
    scene = section_scene(
        section,
        source=given.section,
        name=name,
        spacing=given.spacing_m,
        unit=given.unit,
        materials=read_materials(given.materials) if given.materials else None,
        snap=given.snap,
        ends=given.ends,
    )
    scene = _mark_liquefied(scene, given)
    if given.water_level is None:
        return scene
    if scene.has_water:
        raise InputError(
            f"--water-level {given.water_level:g}: {given.section} has a water table already"
        )
    if not given.water_level > scene.ground.lowest:
        raise InputError(
            f"--water-level {given.water_level:g}: must lie above the base at "
            f"{scene.ground.lowest:g} m"
        )
    document = {**scene.model_dump(), "water_level": given.water_level}
    return scene_from_mapping(document, "--water-level")


def _mark_liquefied(scene: Scene, given: Given) -> Scene:
    """Mark the materials of the zones named; refuse a slide in which none is liquefied."""
    named, source = given.liquefied, given.section
    zones = {zone.name: zone.material for zone in scene.zones}
    for zone in named:
        if zone not in zones:
            raise InputError(f"--liquefied {zone}: no such zone; there are {', '.join(zones)}")
    document = scene.model_dump()
    for zone in named:
        material = zones[zone]
        others = [name for name, other in zones.items() if other == material and name not in named]
        if others:
            raise InputError(
                f"--liquefied {zone}: its material {material!r} is also that of {others[0]}; give "
                "the liquefied zone a material of its own"
            )
        document["materials"][material]["liquefied"] = True
    liquefied = {
        name: fields for name, fields in document["materials"].items() if fields["liquefied"]
    }
    if not liquefied and given.has_slid:
        raise InputError(
            f"{source}: no zone is liquefied; name those whose S_r is unknown with --liquefied "
            f"ZONE; there are {', '.join(zones)}"
        )
    for name, fields in liquefied.items():
        if fields["friction_deg"] != 0.0 or not fields["cohesion_kpa"] > 0.0:
            raise InputError(
                f"{source}: material {name!r} is liquefied: its friction_deg must be 0 and its "
                "cohesion_kpa a first guess of S_r greater than 0 (got "
                f"{fields['friction_deg']:g} and {fields['cohesion_kpa']:g})"
            )
    return Scene.model_validate(document)


# --- the survey ---


def _runouts(given: Sequence[str], profile: Profile | None, scene: Scene) -> list[Runout]:
    """The runouts given, and for the other sides those where a profile ends beyond the foot."""
    found = {side: _runout(text, side, scene) for text in given for side in [_side(text)]}
    if len(found) < len(given):
        raise InputError("--runout: a side is given twice")
    for side in ("left", "right"):
        if profile is not None and side not in found:
            runout = _runout_of_profile(profile, side, scene)
            if runout is not None:
                found[side] = runout
    if profile is not None and not found:
        raise InputError(
            "no runout is known: give --runout SIDE=M, or --profile with a survey that reaches a "
            "toe beyond the foot of the section"
        )
    return [found[side] for side in ("left", "right") if side in found]


def _side(text: str) -> Side:
    word = text.partition("=")[0].strip()
    for side in SIDES:
        if side == word:
            return side
    raise InputError(f"--runout {text}: must look like left=53 or right=6.5+-1")


def _runout(text: str, side: Side, scene: Scene) -> Runout:
    given = text.partition("=")[2].replace("±", "+-").replace("+/-", "+-")
    value, plus_minus, std = given.partition("+-")
    try:
        number = float(value)
        spread = float(std) if plus_minus else None
    except ValueError:
        point = "; a decimal comma is written as a point" if "," in text else ""
        raise InputError(
            f"--runout {text}: must look like left=53 or right=6.5+-1{point}"
        ) from None
    if not 0.0 < number < 1e5 or (spread is not None and not 0.0 < spread < 1e5):
        raise InputError(f"--runout {text}: runout and its uncertainty must be greater than 0")
    assumed = max(ASSUMED_SHARE * number, scene.spacing)
    return Runout(side, number, spread or assumed, spread is not None, "")


def _runout_of_profile(profile: Profile, side: Side, scene: Scene) -> Runout | None:
    """How far a profile runs beyond the foot; None: not at all, or it ends above the base."""
    end = 0 if side == "left" else -1
    outward = -1.0 if side == "left" else 1.0
    x, y = float(profile.x[end]), float(profile.y[end])
    value = outward * (x - scene.foot(side))
    thin = max(0.5, scene.spacing)
    if value < scene.spacing or y - float(scene.ground.height(x)) > thin:
        return None
    std = max(ASSUMED_SHARE * value, scene.spacing)
    return Runout(side, round(value, 3), std, False, f"{side} end of the surveyed profile")


def _with_room(scene: Scene, runouts: Sequence[Runout], profile: Profile | None) -> Scene:
    """The scene with a domain that holds the profile and the toes, in whole cells."""
    domain = scene.domain
    places = (
        [domain.x_min, domain.x_max]
        if profile is None
        else [domain.x_min, domain.x_max, profile.x.min(), profile.x.max()]
    )
    for runout in runouts:
        outward = -1.0 if runout.side == "left" else 1.0
        places.append(scene.foot(runout.side) + 1.2 * outward * runout.value_m)
    cell = scene.cell_size
    left = domain.x_min - cell * -(-max(domain.x_min - min(places), 0.0) // cell)
    right = domain.x_max + cell * -(-max(max(places) - domain.x_max, 0.0) // cell)
    return scene.changed(domain={**domain.model_dump(), "x_min": left, "x_max": right})


# --- the folder ---


def _write(
    folder: Path,
    scene: Scene,
    runouts: Sequence[Runout],
    profile: Profile | None,
    words: CaseWords,
) -> None:
    """Write the files of a drawn section."""
    texts = {
        "scene.yaml": scene_file_text(scene, words),
        "README.md": readme_text(scene, runouts, profile, words),
    }
    if runouts:
        toes = [toe_name(runout) for runout in runouts]
        texts["measurements.yaml"] = measurements_text(scene, runouts, profile, words)
        texts["inversion.yaml"] = inversion_text(scene, toes)
    if profile is not None:
        texts[PROFILE_FILE] = profile_text(profile, words)
    write_case(folder, texts)


def write_case(folder: Path, texts: Mapping[str, str]) -> None:
    """Write files next to their place, load them as an inversion does, and put them there.

    Raises:
        InputError: the folder cannot be written, or the case does not hold together; one line.
    """
    parent = make_folder(folder.parent)
    try:
        temporary = Path(tempfile.mkdtemp(prefix=f".{folder.name}.", dir=parent))
    except OSError as error:
        raise InputError(f"{parent}: cannot be written: {error.strerror}") from None
    try:
        for name, text in texts.items():
            (temporary / name).write_text(text, encoding="utf-8")
        try:
            case = load_case(temporary)
            if "inversion.yaml" in texts:
                inversion_case(case)
        except InputError as error:
            raise InputError(str(error).replace(str(temporary), str(folder))) from None
        temporary.chmod(0o755)
        os.rename(temporary, folder)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
