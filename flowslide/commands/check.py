"""`flowslide check`: scene files and cases, and what they hold."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from flowslide.commands import options

if TYPE_CHECKING:
    from geometry.scenes.fill import MaterialPoints
    from geometry.scenes.scene import Scene
    from geometry.survey.measurements import Measurements
    from geometry.survey.sets import Sets

DESCRIPTION = (
    "Check scene files, and in the folder of a case its measurements and its question as well. The "
    "first one that is not valid ends the command with one line and exit code 2."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    parser.add_argument(
        "scenes",
        nargs="+",
        metavar="SCENE",
        help="scene files, folders with a scene.yaml or with NNNNN.json files, or names of cases",
    )
    parser.add_argument("--quiet", action="store_true", help="print the sum only")
    options.add_effects(parser)
    options.add_measurements_code(parser)


def run(arguments: argparse.Namespace) -> None:
    """Check them one after another."""
    from flowslide import api
    from geometry.doubts import missed_share
    from geometry.random_scenes.sketch import signed_area
    from geometry.scenes.fill import fill
    from geometry.scenes.scene import load_scene, scene_files
    from geometry.scenes3d.scene3d import is_body
    from mpm_taichi.effects import effects_on

    solid = [text for text in arguments.scenes if is_body(text)]
    for text in solid:
        _check_3d(text)
    flat = [text for text in arguments.scenes if text not in solid]
    if not flat:
        return
    paths = scene_files(flat)
    points_in_all, draws, worst = 0, 0, 0.0
    for number, path in enumerate(paths):
        scene = load_scene(path)
        effects_on(scene, str(path))
        measurements = measurements_beside(path, scene)
        if measurements is not None and (path.parent / "inversion.yaml").is_file():
            api.load_question(path.parent)
        counted = _blow_counts_beside(path, scene)
        points = fill(scene)
        area = sum(abs(signed_area(zone.polygon)) for zone in scene.zones)
        missed = missed_share(scene, points)
        worst = max(worst, abs(missed))
        points_in_all += len(points)
        draws += scene.origin.draws if scene.origin else 0
        if arguments.quiet:
            continue
        if number == 0:
            print(
                f"{'scene':<24}{'zones':>6}{'points':>8}{'size m':>14}"
                f"{'area m²':>10}{'filled':>9}{'draws':>7}"
            )
        drawn = scene.origin.draws if scene.origin else "-"
        filled = f"{100.0 * (1.0 + missed):.2f} %"
        print(
            f"{scene.name:<24}{len(scene.zones):>6}{len(points):>8}{_size(scene):>14}"
            f"{area:>10.1f}{filled:>9}{drawn:>7}"
        )
        print_ends(scene)
        print_doubts(scene, measurements, points)
        if measurements is not None:
            _print_measurements(measurements)
        if counted:
            print(f"  blow counts of zones {', '.join(counted)}")
    print(
        f"{len(paths)} valid, {points_in_all} points, filled to within {100.0 * worst:.2f} % of "
        "the area" + (f", {draws} draws" if draws else "")
    )


def _size(scene: Scene) -> str:
    """Length and height of the zones [m]."""
    x = [x for zone in scene.zones for x, _ in zone.polygon]
    low, high = scene.extent
    return f"{max(x) - min(x):.4g} x {high - low:.4g}"


def _check_3d(text: str) -> None:
    from geometry.doubts import SAME_VOLUME
    from geometry.scenes3d.fill3d import drawn_volume, volume_left_out
    from geometry.scenes3d.scene3d import load_scene_3d
    from geometry.survey3d.survey import FILE_NAME, load_survey
    from mpm_taichi.solver3d.problem import problem_of, refuse_flowing_water

    scene = load_scene_3d(text)
    problem = problem_of(scene)
    refuse_flowing_water(problem)
    x_min, x_max, y_min, y_max, _ = problem.domain
    print(
        f"{problem.name}: three-dimensional, {len(problem.position)} points, "
        f"{problem.volume.sum():.4g} m³, {x_max - x_min:g} x {y_max - y_min:g} m in plan"
    )
    if scene.ground is not None:
        drawn = drawn_volume(scene)
        apart = problem.volume.sum() / drawn - 1.0
        print(
            f"  {drawn:.4g} m³ between the rasters; the points hold {100.0 * apart:+.1f} %"
            + ("; a smaller spacing comes nearer" if abs(apart) > SAME_VOLUME else "")
        )
        if (beyond := volume_left_out(scene)) > SAME_VOLUME * drawn:
            print(
                f"  doubtful: {beyond:.4g} m³ lie beyond the last whole cell and are left out; "
                "rasters of a whole number of cells, twice the spacing, hold all of it"
            )
    folder = Path(text) if Path(text).is_dir() else Path(text).parent
    if (folder / FILE_NAME).is_file():
        _print_measurements(load_survey(folder, scene))


def print_doubts(
    scene: Scene, measurements: Measurements | None = None, points: MaterialPoints | None = None
) -> None:
    """Print what is hardly meant in a section and its survey; see `geometry.doubts.case_doubts`."""
    from geometry.doubts import case_doubts

    for line in case_doubts(scene, measurements, points):
        print(f"  doubtful: {line}")


def print_ends(scene: Scene) -> None:
    """Print where the ground goes on, and where the section ends in a free face."""
    import numpy as np
    import shapely

    from geometry.scenes.polygon_checks import on_verticals
    from geometry.sides import SIDES, outward_of
    from geometry.survey.columns import toe_thickness

    whole = shapely.union_all([shapely.Polygon(zone.polygon) for zone in scene.zones])
    for side in SIDES:
        end = scene.end(side)
        x = end - outward_of(side) * 0.05 * scene.spacing
        (cut,) = on_verticals(whole, np.array([x]))
        if scene.domain.goes_on(side):
            front = [scene.zones[number].name for number in scene.front_zones(side)]
            toe = f"the toe there is that of {', '.join(front)}" if front else "no toe there"
            print(
                f"  the ground goes on to the {side} of x = {end:g} m, beyond a face of "
                f"{cut.length:.3g} m; {toe}. Where the soil can run out of it: {side}: free"
            )
        elif cut.length > toe_thickness(scene.spacing):
            print(
                f"  the section ends on the {side} in a free face of {cut.length:.3g} m at x = "
                f"{end:g} m, from which a runout is counted. Where the ground goes on: {side}: far"
            )


def measurements_beside(path: Path, scene: Scene) -> Measurements | None:
    """The measurements of the case whose scene this is, checked against it; None: no case."""
    from geometry.survey.measurements import FILE_NAME, load_measurements

    if path.name != "scene.yaml" or not (path.parent / FILE_NAME).is_file():
        return None
    return load_measurements(path.parent, scene)


def _blow_counts_beside(path: Path, scene: Scene) -> list[str]:
    """Zones with a blow count, of the case whose scene this is; empty: no case, or none."""
    from geometry.survey.blow_counts import load_blow_counts

    return list(load_blow_counts(path.parent, scene)) if path.name == "scene.yaml" else []


def _print_measurements(measurements: Sets) -> None:
    for name, entries in measurements.sets.items():
        numbers = sum(len(entry.values) for entry in entries)
        held = sum(int(entry.held_out_values.sum()) for entry in entries)
        drawn = sum(len(entry.values) for entry in entries if entry.constructed)
        kinds = ", ".join(f"{entry.name} ({entry.type})" for entry in entries)
        print(
            f"  measurements {name!r}: {numbers} values, {held} held out, {drawn} constructed: "
            f"{kinds}"
        )
