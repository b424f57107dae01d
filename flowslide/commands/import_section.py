"""`flowslide import`: a scene from a drawn section."""

from __future__ import annotations

import argparse
from pathlib import Path

from flowslide.commands import options
from flowslide.commands.check import print_doubts, print_ends
from pipeline.cli import InputError

DESCRIPTION = (
    "Make a scene of a section (.csv, .geojson, .json, .dxf, .f2grid, .gsz). Zones are closed "
    "outlines, named by the column zone, the property name, the layer, the group of a FLAC2D grid "
    "or the region of a GeoStudio file; the names ground and water mark the base and the water "
    "table."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    parser.add_argument("section", metavar="SECTION", help="the drawing")
    options.add_out(parser, "scene file, .yaml or .json", metavar="FILE", required=True)
    options.add_spacing(parser, "1")
    parser.add_argument("--name", help="of the scene; default: the name of the drawing")
    options.add_drawing(parser)


def run(arguments: argparse.Namespace) -> None:
    """Read the section, write the scene."""
    from geometry.scenes.drawings import (
        read_materials,
        read_section,
        reading,
        section_scene,
    )
    from geometry.scenes.fill import point_count
    from geometry.scenes.scene import save_scene

    if Path(arguments.out).suffix.lower() not in (".json", ".yaml", ".yml"):
        raise InputError(f"--out {arguments.out}: scene files end in .yaml or .json")
    section = read_section(arguments.section)
    for line in reading(section, arguments.unit):
        print(line)
    scene = section_scene(
        section,
        source=arguments.section,
        name=arguments.name or Path(arguments.section).stem,
        spacing=arguments.spacing or 1.0,
        unit=arguments.unit,
        materials=read_materials(arguments.materials) if arguments.materials else None,
        snap=arguments.snap,
        ends=options.ends_of(arguments),
    )
    save_scene(scene, arguments.out)
    print(f"wrote {arguments.out}: {len(scene.zones)} zones, {point_count(scene)} points")
    print_ends(scene)
    print_doubts(scene)
