"""Options that several commands share, each described once."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from pathlib import Path

from pipeline.cli import InputError, add_common

DEVICES = ("cpu", "cuda")
PICTURE = "png, svg or pdf"


def add_case(parser: argparse.ArgumentParser) -> None:
    """Add CASE."""
    parser.add_argument("case", metavar="CASE", help="case folder, or its name in case_histories")


def add_out(
    parser: argparse.ArgumentParser, words: str, *, metavar: str = "DIR", required: bool = False
) -> None:
    """Add `--out`: a folder, or with `metavar` FILE a file."""
    parser.add_argument("--out", metavar=metavar, required=required, help=words)


def add_scale(parser: argparse.ArgumentParser, words: str, *, required: bool = False) -> None:
    """Add `--scale`."""
    parser.add_argument("--scale", metavar="NAME", required=required, help=words)


def add_spacing(parser: argparse.ArgumentParser, default: str = "the case's own") -> None:
    """Add `--spacing`."""
    parser.add_argument(
        "--spacing",
        type=float,
        metavar="M",
        help=f"distance between material points [m]; default: {default}",
    )


def add_threads(parser: argparse.ArgumentParser) -> None:
    """Add `--threads`."""
    parser.add_argument("--threads", type=int, metavar="N", help="CPU threads; default: all")


def add_engine(parser: argparse.ArgumentParser, *, default: str | None = "mpm") -> None:
    """Add `--engine`: one without a trained model; no `default`: the case decides."""
    from inversion.engines.registry import engines

    parser.add_argument(
        "--engine",
        choices=[name for name, engine in engines().items() if not engine.trained],
        default=default,
        help="mpm3d: over the width of CASE/scene3d.yaml; default: mpm"
        + ("" if default else ", of a scene3d.yaml mpm3d"),
    )


def add_device(parser: argparse.ArgumentParser) -> None:
    """Add `--device` and `--threads`."""
    parser.add_argument("--device", choices=DEVICES, default="cpu", help="default: cpu")
    add_threads(parser)


def add_set_of_measurements(parser: argparse.ArgumentParser) -> None:
    """Add `--set-of-measurements`."""
    parser.add_argument(
        "--set-of-measurements", metavar="NAME", help="default: the one that the file names"
    )


def add_drawing(parser: argparse.ArgumentParser) -> None:
    """Add what is said of a drawn section: `--materials`, `--unit` and `--snap`."""
    parser.add_argument("--materials", metavar="FILE", help="YAML with the fields of each material")
    parser.add_argument(
        "--unit",
        choices=("m", "mm", "cm", "dm", "km", "ft", "in", "yd", "us_ft"),
        help="of the drawing; default: its own, or m",
    )
    parser.add_argument(
        "--snap", type=float, default=0.0, metavar="M", help="join vertices closer than M metres"
    )
    for side in ("left", "right"):
        parser.add_argument(
            f"--{side}",
            choices=("far", "free"),
            help=f"the {side} end of the section: far, the ground goes on beyond it; free, the "
            "soil can run out of it; default: far where the drawing ends in a face",
        )


def ends_of(arguments: argparse.Namespace) -> dict[str, str]:
    """What `--left` and `--right` say of the ends of a section."""
    stated = {side: getattr(arguments, side) for side in ("left", "right")}
    return {side: end for side, end in stated.items() if end is not None}


def add_effects(parser: argparse.ArgumentParser) -> None:
    """Add `--effects FILE`, which may be repeated."""
    parser.add_argument(
        "--effects",
        action="append",
        default=[],
        metavar="FILE",
        dest="effect_files",
        help="Python file with your own effects or material law; it is executed "
        "(docs/how-to/extend.md)",
    )


def add_measurements_code(parser: argparse.ArgumentParser) -> None:
    """Add `--measurements-code FILE`, which may be repeated."""
    parser.add_argument(
        "--measurements-code",
        action="append",
        default=[],
        metavar="FILE",
        dest="measurement_files",
        help="Python file with your own types of measurement; it is executed "
        "(docs/how-to/extend.md)",
    )


def add_simulating(parser: argparse.ArgumentParser) -> None:
    """Add what every command that simulates a case takes: device, code of one's own, settings."""
    add_device(parser)
    add_effects(parser)
    add_measurements_code(parser)
    add_common(parser)


def name_3d(text: str) -> str:
    """Name of the results of a three-dimensional scene: that of its folder."""
    path = Path(text)
    return (path.parent if path.is_file() else path).resolve().name


def refuse_in_3d(arguments: argparse.Namespace, given: Mapping[str, object]) -> None:
    """Refuse what three dimensions do not have: options that are given, and what all share.

    Raises:
        InputError: the first of them.
    """
    shared = {
        "--device cuda": getattr(arguments, "device", "cpu") != "cpu",
        "--effects": arguments.effect_files,
        "--measurements-code": arguments.measurement_files,
    }
    for option, present in {**given, **shared}.items():
        if present:
            raise InputError(f"{option}: not in three dimensions ({arguments.case})")


def check(arguments: argparse.Namespace) -> None:
    """Check the numbers of the shared options.

    Raises:
        InputError: one of them is out of its range.
    """
    rules: tuple[tuple[str, Callable[[float], bool], str], ...] = (
        ("threads", lambda value: value >= 1, "at least 1"),
        ("spacing", lambda value: value > 0.0, "must be greater than 0 m"),
        ("snap", lambda value: value >= 0.0, "must be at least 0"),
    )
    for name, allowed, words in rules:
        value = getattr(arguments, name, None)
        if value is not None and not allowed(value):
            raise InputError(f"--{name} {value:g}: {words}")


def numbers(text: str) -> list[float]:
    """`0,5,20` -> [0.0, 5.0, 20.0], for argparse."""
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r}: numbers with commas between, 0,5,20") from None


def positive(text: str) -> int:
    """`12` -> 12, for argparse; 0 is refused."""
    if not text.isdecimal() or int(text) == 0:
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number of at least 1")
    return int(text)
