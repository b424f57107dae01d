"""Effects on the command line: `--effects FILE`, the command `effects`, effects in words."""

from __future__ import annotations

import argparse
from collections.abc import Iterable

from mpm_taichi.effects.framework.base import Effect
from mpm_taichi.effects.framework.registry import effect, effects, load_effects_file


def add_effects_option(parser: argparse.ArgumentParser) -> None:
    """Add `--effects FILE`, which may be repeated; `load_given_effects` acts on it."""
    parser.add_argument(
        "--effects",
        action="append",
        default=[],
        metavar="FILE",
        dest="effect_files",
        help="Python file with your own effects; it is executed (docs/how-to/your-own-effect.md)",
    )


def load_given_effects(arguments: argparse.Namespace) -> list[Effect]:
    """Load the files of `--effects`; see `registry.load_effects_file`."""
    return [one for path in arguments.effect_files for one in load_effects_file(path)]


def add_effects_command(commands: argparse._SubParsersAction) -> None:
    """Add the command `effects`, which lists what a scene can switch on."""
    parser = commands.add_parser(
        "effects", help="list the physical effects that a scene can switch on"
    )
    parser.add_argument("names", nargs="*", metavar="NAME", help="of effects; default: all")
    parser.add_argument(
        "--markdown", action="store_true", help="as the table of docs/method/effects.md"
    )
    add_effects_option(parser)
    parser.set_defaults(handler=_list)


def _list(arguments: argparse.Namespace) -> None:
    load_given_effects(arguments)
    chosen = [effect(name) for name in arguments.names] or effects().values()
    print((effects_table if arguments.markdown else effects_text)(chosen))


def effects_table(effects: Iterable[Effect]) -> str:
    """A Markdown table of effects: what each is, its law, its amplitude, its parameters."""
    rows = ["| effect | because ... | law | amplitude | parameters |", "|---|---|---|---|---|"]
    for one in effects:
        cells = (f"`{one.name}`", one.words, one.equation, _amplitude(one), _parameters(one))
        rows.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    return "\n".join(rows)


def effects_text(effects: Iterable[Effect]) -> str:
    """Effects in plain text, a paragraph each."""
    parts = []
    for one in effects:
        lines = [f"{one.name}: {one.words}", f"  law        {one.equation}"]
        lines.append(f"  amplitude  {_amplitude(one)}")
        lines += [f"  parameter  {_parameter(p)}" for p in one.parameters]
        lines += [f"  looks like {one.looks_like}", f"  source     {one.source}"]
        parts.append("\n".join(lines))
    return "\n\n".join(parts)


def _amplitude(one: Effect) -> str:
    scale = one.amplitude
    unit = f" {scale.unit}" if scale.unit else ""
    steps = ", ".join(f"{value:g}" for value in scale.ladder)
    sign = "±" if scale.two_signed else ""
    return f"{scale.meaning}; {scale.low:g} to {scale.high:g}{unit}; tried at {sign}({steps})"


def _parameters(one: Effect) -> str:
    return "; ".join(f"`{p.name}` {p.default:g}: {p.meaning}" for p in one.parameters) or "none"


def _parameter(p) -> str:  # noqa: ANN001
    unit = f" {p.unit}" if p.unit else ""
    return f"{p.name} = {p.default:g}{unit} ({p.low:g} to {p.high:g}): {p.meaning}"
