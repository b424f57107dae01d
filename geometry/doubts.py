"""All that is hardly meant in a section and its survey: what `flowslide check` and the studio say.

In: a scene, and what was measured. Out: a line for each doubt. Nothing here is a fault.
"""

from __future__ import annotations

from collections.abc import Iterator

from geometry.random_scenes.sketch import signed_area
from geometry.scenes.doubts import SPACING, Doubt, doubts, far_feet, far_runouts, thin_layers
from geometry.scenes.fill import MaterialPoints, fill
from geometry.scenes.polygon_checks import gaps
from geometry.scenes.scene import Scene
from geometry.survey.measurements import Measurements
from pipeline.cli import InputError

#: Share by which the volume of points may differ from what was drawn without a remark.
SAME_VOLUME = 0.002
#: Gaps that are named one by one.
MOST_GAPS = 5


def case_doubts(
    scene: Scene, measurements: Measurements | None = None, points: MaterialPoints | None = None
) -> list[Doubt]:
    """Lines on a section and its survey; empty: nothing is doubtful.

    Args:
        scene: the section.
        measurements: of its case; None: there are none.
        points: of the section; None: they are laid here.
    """
    found = [*_left_out(scene, fill(scene) if points is None else points), *_gaps(scene)]
    if scene.origin is not None:  # of a template, whose blocks fly on purpose
        return found
    found += doubts(scene)
    if measurements is not None:
        found += [*_runouts(scene, measurements), *far_feet(scene, measurements.feet(scene))]
    return [*found, *thin_layers(scene)]


def missed_share(scene: Scene, points: MaterialPoints) -> float:
    """Volume of the points beyond what was drawn, as a share of it."""
    area = sum(abs(signed_area(zone.polygon)) for zone in scene.zones)
    return float(points.volume.sum() / area - 1.0)


def _left_out(scene: Scene, points: MaterialPoints) -> Iterator[Doubt]:
    missed = missed_share(scene, points)
    if missed < -SAME_VOLUME:
        area = -missed * points.volume.sum() / (1.0 + missed)
        yield Doubt(
            f"{area:.4g} m² of soil are thinner than half a spacing for long, far from any point, "
            "and left out; a smaller spacing holds them",
            *SPACING,
        )


def _gaps(scene: Scene) -> Iterator[Doubt]:
    try:
        found = gaps({zone.name: zone.polygon for zone in scene.zones}, scene.spacing)
    except InputError as error:
        yield Doubt(str(error))
        return
    for area, (x, y) in found[:MOST_GAPS]:
        yield Doubt(f"gap of {area:.3g} m² between zones at ({x:.2f}, {y:.2f})")
    if len(found) > MOST_GAPS:
        yield Doubt(f"and {len(found) - MOST_GAPS} smaller gaps")


def _runouts(scene: Scene, measurements: Measurements) -> Iterator[Doubt]:
    group = measurements.default_set
    for number, entry in enumerate(measurements.chosen()):
        if entry.is_runout:
            place = ("measurements", "sets", group, number, entry.type, "value_m")
            for line in far_runouts(scene, entry.values[:1]):
                yield Doubt(f"{entry.name}: {line}", *place)
