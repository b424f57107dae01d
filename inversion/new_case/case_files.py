"""The texts of a new case folder: YAML with comments, and a README with places to fill.

In: a checked scene and what was measured. Out: texts. Everything in them is read by the commands;
what a person must still add is marked FILL IN.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from geometry.dimensions.family import Dimension
from geometry.random_scenes.materials import GRAVITY
from geometry.scenes.scene import Scene, scene_from_mapping
from geometry.sides import Side
from geometry.survey.profiles import Profile
from inversion.problem.scene_changes import pool_at
from pipeline.cli import InputError
from pipeline.files import yaml_text

#: Standard deviation that is assumed of the level of the water [m].
LEVEL_STD = 0.5

FILL_IN = "FILL IN"
PROFILE_FILE = "post_failure_profile.csv"
#: Bounds of S_r over rho g H. A vertical cut of height H stands with a cohesion of rho g H / 3.83
#: (Taylor 1937), any other slope with less; with 0.002 rho g H a heap as wide as a dam spreads on
#: level ground over some 15 of its heights, where S_r x = rho g h^2 / 2 holds its surface.
LOW_SHARE, HIGH_SHARE = 0.002, 0.3
#: A first guess lies at least this factor within them.
ROOM = 2.0


@dataclass(frozen=True)
class Runout:
    """A measured runout.

    Attributes:
        side: left or right.
        value_m: distance of the toe from the foot before the slide [m].
        std_m: its standard deviation [m].
        std_given: stated by the user, not assumed.
        read_from: where it was read, in words; empty: given as a number.
    """

    side: Side
    value_m: float
    std_m: float
    std_given: bool
    read_from: str


@dataclass(frozen=True)
class CaseWords:
    """Facts of the case used in the texts.

    Attributes:
        name: of the case.
        section_file: where its section comes from.
        upstream: side.
        profile_std_m: of the survey [m]; None: no profile.
        sourced: every number has its source already.
    """

    name: str
    section_file: str
    upstream: Side
    profile_std_m: float | None
    sourced: bool = False

    @property
    def title(self) -> str:
        """The name in words."""
        return self.name.replace("_", " ").title()


def scene_file_text(scene: Scene, words: CaseWords) -> str:
    """`scene.yaml`: each part with a comment above."""
    document = scene.model_dump(mode="json", exclude_none=True, exclude={"effects", "origin"})
    document["description"] = f"Section before the slide, from {words.section_file}."
    for zone in document["zones"]:
        zone.pop("initial_velocity")
        zone.pop("kinematic")
    for name, material in scene.materials.items():
        if material.source:
            document["materials"][name]["source"] = material.source
    comments = {
        "name": (
            f"{words.title}: the section before the slide. Keys: docs/method/geometry.md. "
            "Lengths in m.\n"
            + (
                "README.md says where the numbers come from."
                if words.sourced
                else f"{FILL_IN}: where the section, the strengths and the water come from, in "
                "README.md."
            )
        ),
        "domain": (
            "Room for the slide; open walls give way where more is needed. left, right: far where "
            "the ground\ngoes on beyond the end of the section, free where soil can run out of it."
        ),
        "ground": "The rigid base. rough: soil slips on it where its own strength is exceeded.",
        "zones": "Outlines in order. A zone's material is a key of `materials`.",
        "materials": (
            "Strength while the soil flows. Where liquefied is true, friction_deg is 0 and "
            "cohesion_kpa is S_r:\nhere a first guess, which the back-analysis replaces."
        ),
        "water_level": "The pool; `null` takes all water away, the phreatic line included.",
        "phreatic_line": "The water table; without it the pool's level holds everywhere.",
        "spacing": "Distance between material points: half of it costs eight times the time.",
    }
    parts = []
    for key, value in document.items():
        if key in comments:
            parts.append(_comment(comments[key]))
        if key == "zones":
            parts += ["zones:\n", *(_entry(zone, {}, indent=2) for zone in value)]
        elif isinstance(value, dict):
            block = "".join(f"  {line}\n" for line in _dump(value).splitlines())
            parts.append(f"{key}:\n{block}")
        else:
            parts.append(_dump({key: value}))
    if "water_level" not in document and not words.sourced:
        parts.append(
            _comment(f"{FILL_IN} if there was water: water_level, such as 12.5, and phreatic_line.")
        )
    return "".join(parts)


def measurements_text(
    scene: Scene, runouts: Sequence[Runout], profile: Profile | None, words: CaseWords
) -> str:
    """`measurements.yaml`: the toes, and the profile where there is one."""
    crest = max(((y, x) for zone in scene.zones for x, y in zone.polygon), default=(0.0, 0.0))[0]
    at_crest = [x for zone in scene.zones for x, y in zone.polygon if abs(y - crest) < 1e-6]
    initial: dict[str, float] = {
        "toe_left_x_m": scene.foot("left"),
        "toe_right_x_m": scene.foot("right"),
        "crest_x_m": round(0.5 * (min(at_crest) + max(at_crest)), 3),
        "crest_y_m": crest,
    }
    if scene.water_level is not None:
        initial["pool_y_m"] = scene.water_level
    text = _comment(
        f"{words.title}: what was measured after the slide. Types and keys: "
        "docs/method/measurements.md.\n"
        f"{FILL_IN}: confidence (published, paper, secondary, recalled, assumed, constructed) and "
        "source of each entry."
    )
    text += _dump({"case": words.name})
    text += _dump({"upstream": words.upstream}).rstrip() + "   # which side of the section\n"
    text += _comment("The section before the slide: runouts are counted from its feet.")
    text += _dump({"initial": initial})
    text += "default_set: field\nsets:\n  field:\n"
    for runout in runouts:
        text += _entry(_toe_entry(runout), _std_comment(runout))
    if profile is not None:
        text += _entry(
            {
                "name": "profile",
                "type": "surface_profile",
                "file": PROFILE_FILE,
                "std_m": words.profile_std_m,
                "correlation_length_m": round((crest - scene.ground.lowest) / 3.0, 2),
                "std_is": "assumed",
                "confidence": "assumed",
                "source": f"{FILL_IN}: survey, sheet, date",
            },
            {
                "std_m": "of the survey's elevations",
                "correlation_length_m": "assumed: how far an error reaches along the line",
            },
        )
        text += "      # held_out_x_m: [from, to]   # a block that enters no fit and judges it\n"
    text += _comment(
        "More types: crest_settlement, final_slope, freeboard, heave, marker_displacement, "
        "slip_depth, toe_history, velocity."
    )
    return text


def inversion_text(scene: Scene, toes: Sequence[str], dimensions: Sequence[Dimension] = ()) -> str:
    """`inversion.yaml`: S_r of every liquefied material, fitted to the toes.

    Args:
        scene: with a liquefied material at least.
        toes: names of the measured runouts; none: all that is measured is fitted.
        dimensions: of a section that nobody drew; none: it was drawn.
    """
    text = _comment("What is asked of this case. Keys: docs/method/inversion.md.")
    text += "parameters:\n"
    low, high = strength_bounds(scene)
    for name, zones in _liquefied(scene).items():
        start = scene.materials[name].cohesion_kpa
        text += _entry(
            {
                "name": f"residual_strength_{name}",
                "label": f"S_r of the {name.replace('_', ' ')}",
                "zones": zones,
                "property": "residual_strength_kpa",
                "start": start,
                "low": min(low, two_figures(start / ROOM)),
                "high": max(high, two_figures(start * ROOM)),
            },
            {
                "zones": "share one value",
                "start": "first guess, that of scene.yaml [kPa]",
                "low": "runs 15 heights of the section and more",
                "high": "holds any slope of that height",
            },
            indent=2,
        )
    text += _comment(
        "S_r is the same everywhere in its zones. To find the ratio S_r / sigma'_v0 instead,\n"
        "which makes deeper soil stronger: property: strength_ratio, start: 0.1, low: 0.02,\n"
        "high: 0.5 (no unit). Both readings side by side, among the variants:\n"
        "  - {name: strength in proportion to the stress, property: strength_ratio}"
    )
    text += _comment("Measurements that are fitted; all others are compared with the answer.")
    if toes:
        text += _dump({"fit": list(toes)})
    text += (
        f"loss: {'runout' if toes else 'misfit'}   # runout: squared error of the runouts; "
        "misfit: all of `fit`, standardised\n"
    )
    text += _variants(scene)
    return text + _sensitivities(scene, dimensions)


def strength_bounds(scene: Scene) -> tuple[float, float]:
    """Residual strengths [kPa] between which a slope of the section's height may or may not run."""
    low, high = scene.extent
    density = max(material.density for material in scene.materials.values())
    scale_kpa = density * GRAVITY * (high - low) / 1000.0
    return two_figures(LOW_SHARE * scale_kpa), two_figures(HIGH_SHARE * scale_kpa)


def two_figures(value: float) -> float:
    """A positive number, rounded to two figures."""
    return float(f"{value:.2g}")


def readme_text(
    scene: Scene, runouts: Sequence[Runout], profile: Profile | None, words: CaseWords
) -> str:
    """`README.md`: where every number comes from, with places to fill."""
    rows = [f"| section, zones | {words.section_file} | {FILL_IN} | {FILL_IN} |"]
    for name, material in scene.materials.items():
        strength = f"phi {material.friction_deg:g} deg, c {material.cohesion_kpa:g} kPa"
        if material.liquefied:
            strength = f"S_r {material.cohesion_kpa:g} kPa, a first guess of what is to be found"
        rows.append(f"| {name} | {strength}, {material.density:g} kg/m³ | {FILL_IN} | {FILL_IN} |")
    water = "none" if scene.water_level is None else f"y = {scene.water_level:g}"
    rows.append(f"| water | {water} | {FILL_IN} | {FILL_IN} |")
    for runout in runouts:
        source = runout.read_from or FILL_IN
        given = "" if runout.std_given else ", assumed"
        rows.append(
            f"| runout of the {runout.side} toe | {runout.value_m:g} m | "
            f"{runout.std_m:.3g} m{given} | {source} |"
        )
    if profile is not None:
        rows.append(
            f"| profile after the slide | `{PROFILE_FILE}`, {len(profile.x)} points | "
            f"{words.profile_std_m:g} m | {FILL_IN} |"
        )
    table = "\n".join(rows)
    files = ""
    if runouts:
        files = (
            "| `measurements.yaml` | what was measured after it |\n"
            "| `inversion.yaml` | which strengths are unknown |\n"
        )
    return f"""# {words.title}

{FILL_IN}: {"what failed, when, and how" if runouts else "what stands there, and since when"}.

| file | what |
|---|---|
| `scene.yaml` | the section{" before the slide" if runouts else ""}, from `{words.section_file}` |
{files}
## How far each number may be trusted

Axes: x to the right, y up, metres; upstream is {words.upstream}.
{FILL_IN}: what x = 0 and y = 0 are.

| number | value | uncertainty | confidence and source |
|---|---|---|---|
{table}
| stiffness | E 30 MPa, nu 0.3 unless the drawing says otherwise | | assumed |
"""


# --- parts ---


def toe_name(runout: Runout) -> str:
    """Name of a runout among the measurements."""
    return f"{runout.side} toe"


def _toe_entry(runout: Runout) -> dict[str, Any]:
    return {
        "name": toe_name(runout),
        "type": "toe_runout",
        "side": runout.side,
        "value_m": runout.value_m,
        "std_m": round(runout.std_m, 4),
        "std_is": "published" if runout.std_given else "assumed",
        "confidence": "assumed",
        "source": f"{FILL_IN}: {runout.read_from or 'who measured it, and when'}",
    }


def _std_comment(runout: Runout) -> dict[str, str]:
    if runout.std_given:
        return {"std_m": "as given"}
    return {"std_m": f"assumed: a tenth, at least one spacing. {FILL_IN}: that of the survey"}


def _variants(scene: Scene) -> str:
    if not scene.has_water:
        return ""
    text = _comment(
        "Other readings of the question, each solved and reported in addition to the answer."
    ) + ("variants:\n  - {name: without water, water: none}\n")
    if scene.head_falls:
        text += "  - {name: without the thrust of the water, water: buoyant}\n"
    return text


def _sensitivities(scene: Scene, dimensions: Sequence[Dimension]) -> str:
    """Sensitivities, one standard deviation each; only those possible in this section."""
    text = _comment("What else moves the answer, one standard deviation each.") + "sensitivities:\n"
    text += _section_lines(scene) if not dimensions else _dimension_lines(dimensions)
    if scene.head_falls:
        text += (
            "  - {name: water that stays where it was, kind: simulation, "
            "simulation: {water_face: fixed}}\n"
        )
    if _bears(scene, 2.0):
        text += "  - {name: cell size, kind: cell_size, factor: 2.0}\n"
    else:
        text += (
            "  - {name: cell size, kind: cell_size, factor: 0.75}   # a zone is too thin for 2\n"
        )
    text += "  - {name: time step, kind: time_step, factor: 0.5}\n"
    return text + "  - {name: transfer, kind: simulation, simulation: {transfer: flip}}\n"


def _dimension_lines(dimensions: Sequence[Dimension]) -> str:
    """Each dimension of a section that nobody drew; their numbers are in its file."""
    return "".join(
        f"  - {{name: {one.label}, kind: dimension, dimension: {one.key}}}\n" for one in dimensions
    )


def _section_lines(scene: Scene) -> str:
    """What is uncertain of a drawn section."""
    text = ""
    zone = next(z for z in scene.zones if scene.materials[z.material].liquefied)
    top = max(y for _, y in zone.polygon)
    # One corner alone would tilt a level top.
    example = ", ".join(
        f"{{at: [{x:g}, {y:g}], move: [0, {scene.cell_size:g}]}}"
        for x, y in zone.polygon
        if math.isclose(y, top, abs_tol=1e-6)
    )
    text += (
        f"  # {FILL_IN}: the top of the liquefied zone, the least certain line of most sections:\n"
        "  # - name: top of the liquefied zone\n"
        "  #   kind: zone_boundary\n"
        f"  #   vertices: [{example}]\n"
    )
    if _pool_may_move(scene, LEVEL_STD):
        text += f"  - {{name: water level, kind: water_level, std_m: {LEVEL_STD}}}   # assumed\n"
    return text


def _bears(scene: Scene, factor: float) -> bool:
    """The section can be filled at another spacing."""
    try:
        scene.changed(spacing=factor * scene.spacing)
    except (InputError, ValueError):
        return False
    return True


def _pool_may_move(scene: Scene, by: float) -> bool:
    """There is water, and its level can be that much higher and lower [m]."""
    if scene.water_level is None:
        return False
    try:
        for level in (scene.water_level - by, scene.water_level + by):
            scene_from_mapping(pool_at(scene, level), scene.name)
    except InputError:
        return False
    return True


def _liquefied(scene: Scene) -> dict[str, list[str]]:
    """Liquefied material -> its zones."""
    return {
        name: [zone.name for zone in scene.zones if zone.material == name]
        for name, material in scene.materials.items()
        if material.liquefied
    }


def profile_text(profile: Profile, words: CaseWords) -> str:
    """The surveyed profile as a CSV file of the case."""
    lines = [
        f"# {words.title}: surface after the slide. {FILL_IN}: survey and date.",
        "x_m,y_m,part",
    ]
    lines += [
        f"{float(x)!r},{float(y)!r},{part}"
        for x, y, part in zip(profile.x, profile.y, profile.part, strict=True)
    ]
    return "\n".join(lines) + "\n"


def _comment(text: str) -> str:
    return "".join(f"# {line}\n" for line in text.splitlines())


def _dump(part: Mapping[str, Any]) -> str:
    """YAML of some keys: numbers, points and lists of them behind the key, the rest below it."""
    text = ""
    for name, value in part.items():
        key = yaml_text({name: 0}).rsplit(": 0", 1)[0]  # quoted where it would be no text
        below = _has_mappings(value)
        inner = yaml_text(
            value,
            width=100,
            default_flow_style=None if below else True,
            allow_unicode=True,
        )
        lines = inner.removesuffix("...\n").splitlines()
        if isinstance(value, dict) and not below or not isinstance(value, dict | list):
            text += f"{key}: {' '.join(line.strip() for line in lines)}\n"
        elif below:
            text += f"{key}:\n" + "".join(f"  {line}\n" for line in lines)
        else:
            text += f"{key}: {lines[0]}\n" + "".join(f"    {line.strip()}\n" for line in lines[1:])
    return text


def _has_mappings(value: Any) -> bool:
    """A mapping within a mapping or a list."""
    items = value.values() if isinstance(value, dict) else value if isinstance(value, list) else []
    return any(isinstance(item, dict) or _has_mappings(item) for item in items)


def _entry(fields: Mapping[str, Any], comments: Mapping[str, str], indent: int = 4) -> str:
    """A list item whose keys may have a comment behind them."""
    lines: list[str] = []
    for key, value in fields.items():
        first, *rest = _dump({key: value}).splitlines()
        lines += [f"{first}   # {comments[key]}" if key in comments else first, *rest]
    marks = ["- ", *["  "] * (len(lines) - 1)]
    return "".join(f"{' ' * indent}{mark}{line}\n" for mark, line in zip(marks, lines, strict=True))
