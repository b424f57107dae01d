"""`python -m inversion new`: a folder for a dam of your own, from a drawn section and a survey.

In: a section (CSV, GeoJSON, DXF) and a measured runout or a surveyed profile. Out: a commented
folder with `scene.yaml`, `measurements.yaml`, `inversion.yaml`, `README.md` and the profile, which
can be checked and inverted as it is. What is assumed says so and waits to be replaced.

Nothing is made up that decides the answer: a zone without strength, a slide without a runout and a
section without a liquefied zone are refused.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from geometry.scenes.drawings import UNITS, read_materials, read_section, section_scene
from geometry.scenes.scene import Scene
from geometry.survey.profiles import Profile, load_profile
from geometry.survey.toe import Side
from inversion.back_analysis.load import load_case
from inversion.new_case.case_files import (
    PROFILE_FILE,
    CaseWords,
    Runout,
    inversion_text,
    measurements_text,
    profile_text,
    readme_text,
    scene_file_text,
)
from pipeline.cli import InputError
from pipeline.config import load_config
from pipeline.files import make_folder

CASES = Path("case_histories")
FORMATS = ("csv", "geojson", "dxf")
NAME = re.compile(r"[a-z][a-z0-9_]*")
#: A runout whose uncertainty is not given is taken to be known to this share, and to one spacing.
ASSUMED_SHARE = 0.1


def add_parser(subparsers: argparse._SubParsersAction) -> argparse.ArgumentParser:
    """Describe the command's options."""
    parser = subparsers.add_parser(
        "new",
        help="make the folder of a case of your own from a drawn section",
        description="Make a commented, working case folder from a section (CSV, GeoJSON, DXF) and "
        "a measured runout or a surveyed profile. docs/start/your-own-case.md shows how.",
    )
    parser.add_argument(
        "case",
        metavar="CASE",
        help=f"name of the case, made in {CASES}/; or a folder, told by a slash in it",
    )
    parser.add_argument("--section", required=True, metavar="FILE", help="the drawing")
    parser.add_argument("--format", choices=FORMATS, help="of the drawing; default: its suffix")
    parser.add_argument("--materials", metavar="FILE", help="YAML with the fields of each material")
    parser.add_argument(
        "--unit", choices=tuple(UNITS), help="of the drawing; default: its own, or m"
    )
    parser.add_argument(
        "--snap", type=float, default=0.0, metavar="M", help="make one of vertices nearer than M m"
    )
    parser.add_argument(
        "--spacing", type=float, metavar="M", help="of material points, m; default: height / 25"
    )
    parser.add_argument(
        "--liquefied",
        action="append",
        default=[],
        metavar="ZONE",
        help="a zone whose S_r is sought, may be repeated; beside those the drawing marks",
    )
    parser.add_argument("--water-level", type=float, metavar="Y", help="pool or water table, m")
    parser.add_argument(
        "--runout",
        action="append",
        default=[],
        metavar="SIDE=M",
        help="measured runout of the toe, such as left=53 or left=53+-6; may be repeated",
    )
    parser.add_argument("--profile", metavar="FILE", help="surveyed surface: CSV with x_m, y_m")
    parser.add_argument(
        "--profile-std", type=float, default=0.5, metavar="M", help="of the survey, m; default 0.5"
    )
    parser.add_argument(
        "--upstream", choices=("left", "right"), default="left", help="default: left"
    )
    return parser


def run(arguments: argparse.Namespace) -> int:
    """Make the folder, check it as an inversion would, and say what comes next."""
    folder = _folder(arguments.case)
    scene = _scene(arguments, folder.name)
    profile = None if arguments.profile is None else load_profile(arguments.profile)
    if not arguments.profile_std > 0:
        raise InputError(f"--profile-std {arguments.profile_std:g}: must be greater than 0")
    runouts = _runouts(arguments.runout, profile, scene)
    scene = _with_room(scene, runouts, profile)
    words = CaseWords(
        folder.name,
        Path(arguments.section).name,
        arguments.upstream,
        None if profile is None else arguments.profile_std,
    )
    _write(folder, scene, runouts, profile, words)
    _tell(folder, scene, runouts)
    return 0


def _tell(folder: Path, scene: Scene, runouts: Sequence[Runout]) -> None:
    ran = ", ".join(f"{r.side} {r.value_m:g} +- {r.std_m:.2g} m" for r in runouts)
    print(f"wrote {folder}: {len(scene.zones)} zones; runout {ran}")
    print("It works as it is; lines with FILL IN wait for what only you know. Next:")
    print(f"  python -m geometry check {folder}")
    print(f"  python -m geometry show {folder} --out {folder.name}.png")
    print(f"  python -m inversion invert {folder} --quick")
    if folder.resolve().parent == CASES.resolve():
        print(f"  snakemake -c 2 invert_{folder.name}")


def _folder(text: str) -> Path:
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


def _scene(arguments: argparse.Namespace, name: str) -> Scene:
    """The section as a scene, with its liquefied zones marked and its water."""
    if not arguments.snap >= 0:
        raise InputError(f"--snap {arguments.snap:g}: must be at least 0")
    if arguments.spacing is not None and not arguments.spacing > 0:
        raise InputError(f"--spacing {arguments.spacing:g}: must be greater than 0")
    section = read_section(arguments.section, arguments.format)
    factor = UNITS[arguments.unit or section.unit or "m"]
    y = [factor * place for ring in section.zones.values() for _, place in ring]
    spacing = arguments.spacing or _round_spacing((max(y) - min(y)) / 25.0)
    scene = section_scene(
        section,
        source=arguments.section,
        name=name,
        spacing=spacing,
        unit=arguments.unit,
        materials=read_materials(arguments.materials) if arguments.materials else None,
        snap=arguments.snap,
    )
    scene = _mark_liquefied(scene, arguments.liquefied, arguments.section)
    if arguments.water_level is None:
        return scene
    if scene.has_water:
        raise InputError(
            f"--water-level {arguments.water_level:g}: {arguments.section} has a water table "
            "already"
        )
    if not scene.ground.lowest < arguments.water_level < scene.domain.y_max:
        raise InputError(
            f"--water-level {arguments.water_level:g}: must lie above the base at "
            f"{scene.ground.lowest:g} m and below {scene.domain.y_max:g} m"
        )
    return scene.changed(water_level=arguments.water_level)


def _round_spacing(length: float) -> float:
    """The next smaller of 0.1, 0.25, 0.5, 1, 2, ... [m]."""
    steps = [step * 10.0**power for power in range(-2, 3) for step in (1.0, 2.5, 5.0)]
    return max([step for step in steps if step <= length], default=steps[0])


def _mark_liquefied(scene: Scene, named: Sequence[str], source: str) -> Scene:
    """Mark the materials of the zones named; refuse a section in which none is liquefied."""
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
    if not liquefied:
        raise InputError(
            f"{source}: no zone is liquefied; name those whose S_r is sought with --liquefied "
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
    if not found:
        raise InputError(
            "no runout is known: give --runout SIDE=M, or --profile with a survey that reaches a "
            "toe beyond the foot of the section"
        )
    return [found[side] for side in ("left", "right") if side in found]


def _side(text: str) -> Side:
    side = text.partition("=")[0].strip()
    if side not in ("left", "right"):
        raise InputError(f"--runout {text}: must look like left=53 or right=6.5+-1")
    return side


def _runout(text: str, side: Side, scene: Scene) -> Runout:
    value, plus_minus, std = text.partition("=")[2].partition("+-")
    try:
        number = float(value)
        spread = float(std) if plus_minus else None
    except ValueError:
        raise InputError(f"--runout {text}: must look like left=53 or right=6.5+-1") from None
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
    places = [domain.x_min, domain.x_max] if profile is None else [
        domain.x_min, domain.x_max, profile.x.min(), profile.x.max()
    ]  # fmt: skip
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
    """Write the files beside their place, load them as an inversion does, and put them there."""
    texts: Mapping[str, Any] = {
        "scene.yaml": scene_file_text(scene, words),
        "measurements.yaml": measurements_text(scene, runouts, profile, words),
        "inversion.yaml": inversion_text(scene, runouts),
        "README.md": readme_text(scene, runouts, profile, words),
    }
    parent = make_folder(folder.parent)
    try:
        temporary = Path(tempfile.mkdtemp(prefix=f".{folder.name}.", dir=parent))
    except OSError as error:
        raise InputError(f"{parent}: cannot be written: {error.strerror}") from None
    try:
        for name, text in texts.items():
            (temporary / name).write_text(text, encoding="utf-8")
        if profile is not None:
            text = profile_text(profile, words)
            (temporary / PROFILE_FILE).write_text(text, encoding="utf-8")
        try:
            load_case(temporary, load_config(None))
        except InputError as error:
            raise InputError(str(error).replace(str(temporary), str(folder))) from None
        temporary.chmod(0o755)
        os.rename(temporary, folder)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
