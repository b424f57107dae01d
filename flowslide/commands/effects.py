"""`flowslide effects`: what a scene can switch on."""

from __future__ import annotations

import argparse

from flowslide.commands import options

DESCRIPTION = "List the physical effects that a scene can switch on."


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    parser.add_argument("names", nargs="*", metavar="NAME", help="of effects; default: all")
    parser.add_argument(
        "--markdown", action="store_true", help="as the table of docs/method/effects.md"
    )
    options.add_effects(parser)


def run(arguments: argparse.Namespace) -> None:
    """List them."""
    from mpm_taichi.effects import effect, effects
    from mpm_taichi.effects.framework.description import effects_table, effects_text

    chosen = [effect(name) for name in arguments.names] or effects().values()
    print((effects_table if arguments.markdown else effects_text)(chosen))
