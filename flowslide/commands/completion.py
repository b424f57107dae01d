"""`flowslide completion`: what makes the shell complete commands, options and files."""

from __future__ import annotations

import argparse

SHELLS = ("bash", "zsh", "tcsh")
FOLDERS = {"CASE", "DIR", "CASE|FOLDER"}
DESCRIPTION = (
    "Print the completion of your shell. bash: flowslide completion bash > "
    "~/.local/share/bash-completion/completions/flowslide; zsh: flowslide completion zsh > "
    "a folder of $fpath, named _flowslide; tcsh: flowslide completion tcsh > a file, and source "
    "it in ~/.cshrc. Then open a new shell."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    parser.add_argument("shell", choices=SHELLS)


def run(arguments: argparse.Namespace) -> None:
    """Print it."""
    import shtab

    from flowslide.command_line import build_parser

    parser = build_parser()
    _prepare(parser, shtab.FILE, shtab.DIRECTORY)
    print(shtab.complete(parser, arguments.shell))


def _prepare(parser: argparse.ArgumentParser, file: dict, folder: dict) -> None:
    """Give every parser its arguments, and every argument that is a path its completion."""
    if hasattr(parser, "complete"):
        parser.complete()
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for inner in action.choices.values():
                _prepare(inner, file, folder)
        elif action.metavar in FOLDERS:
            setattr(action, "complete", folder)  # noqa: B010 - shtab's own attribute
        elif action.metavar and any(word in action.metavar for word in ("FILE", "SCENE", "MODEL")):
            setattr(action, "complete", file)  # noqa: B010
