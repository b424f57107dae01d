"""The command line: `flowslide COMMAND`.

In: what was typed. Out: the exit code of the command. The tables below are all there is to know of
the commands' names; a module of `flowslide.commands` is imported when its command is chosen, and
its own imports wait until it runs, so that every `--help` is there at once.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from typing import Any

from flowslide.commands import options
from pipeline.cli import CommandParser
from pipeline.extras import require


@dataclass(frozen=True)
class Command:
    """A command.

    Attributes:
        module: in `flowslide.commands`.
        help: one line.
        defaults: of its arguments, where they differ from the module's own.
        extra: of the installation, without which it does nothing; empty: it needs none.
    """

    module: str
    help: str
    defaults: Mapping[str, Any] = field(default_factory=dict)
    extra: str = ""


@dataclass(frozen=True)
class Group:
    """A command that has sub-commands.

    Attributes:
        help: one line.
        commands: by name.
        default: the sub-command that is meant where none is named; None: one has to be.
    """

    help: str
    commands: Mapping[str, Command]
    default: str | None = None


NEW = Command("new", "make the folder of a case of your own from a drawn section")
CHECK = Command("check", "check cases or scene files, and print what they hold")
SHOW = Command("show", "draw a scene, or a gallery of many")
IMPORT = Command("import_section", "make a scene of a drawn section (CSV, GeoJSON, DXF)")
SIMULATE = Command("simulate", "simulate a case history and compare it with what was measured")
INVERT = Command("invert", "find the residual strengths of a case history")
REPORT = Command("report", "print results again, rewrite their page, make a PDF of it")
POSTERIOR = Command(
    "posterior", "all that is unknown of a case, before and after its data", extra="posterior"
)
JOINT = Command(
    "joint", "one relation of the strength ratio over several slides", extra="posterior"
)
PREDICT = Command("predict", "how far a slide with a given strength would run")
CLASSICAL = Command("classical", "residual strength by Kinetics, ZIF and IMM")
CATALOGUE = Command("catalogue", "published strengths of 16 flow slides, and our answers")
STUDIO = Command(
    "studio", "a page in the browser: move the strengths, watch it flow", extra="studio"
)
EFFECTS = Command("effects", "list the physical effects that a scene can switch on")

DIAGNOSE = Group(
    "which physical effect does the model of a case lack?",
    {
        "run": Command("diagnosis.diagnose", "the whole loop to a verdict; `run` may be left out"),
        "compare": Command(
            "diagnosis.compare", "fit the base model: is it adequate, where does it fail?"
        ),
        "explain": Command(
            "diagnosis.explain", "rank the effects; what looks alike, what could be hidden"
        ),
        "extend": Command("diagnosis.extend", "add an effect by hand: error before and after"),
        "track": Command("diagnosis.track", "the error over the models so far"),
        "suggest": Command("diagnosis.suggest", "what to measure next"),
    },
    default="run",
)
GNS = Group(
    "learn from simulated slides, and simulate by what was learned",
    {
        "pack": Command("gns.pack", "pack trajectories into what a training reads"),
        "show": Command("gns.show", "draw a packed run, or an overview of packed data"),
        "train": Command("gns.train", "learn from packed data", extra="learned"),
        "evaluate": Command(
            "gns.evaluate", "judge a model on held-out runs; write its card", extra="learned"
        ),
        "rollout": Command("gns.rollout", "simulate a scene by a trained model", extra="learned"),
        "baselines": Command(
            "gns.baselines", "how well runouts of held-out runs are guessed without simulating"
        ),
        "direct-runs": Command("gns.direct_runs", "simulate what the direct models learn from"),
        "direct-train": Command(
            "gns.direct_train", "learn the deposit in one pass, without steps", extra="learned"
        ),
    },
)
SCENES = Group(
    "generated scenes: draw them at random, simulate them",
    {
        "sample": Command("runs.sample", "draw scenes of a scale into a folder"),
        "simulate": Command("runs.simulate", "simulate scenes into a trajectory file"),
    },
)
RUNS = Group(
    "trajectory files: list, draw and export runs",
    {
        "status": Command("runs.status", "list the runs of trajectory files and failures"),
        "show": Command("runs.show", "draw a run: picture (png, svg, pdf) or mp4, gif"),
        "export": Command("runs.export", "write runs for ParaView (vtkhdf) or as tables (csv)"),
    },
)
SETTINGS = Group(
    "the configuration",
    {"check": Command("settings", "check a configuration and print it whole, as YAML")},
)


COMMANDS: dict[str, dict[str, Command | Group]] = {
    "a case, in the order of the work": {
        "new": NEW,
        "import": IMPORT,
        "check": CHECK,
        "show": SHOW,
        "simulate": SIMULATE,
        "invert": INVERT,
        "report": REPORT,
        "classical": CLASSICAL,
        "diagnose": DIAGNOSE,
        "posterior": POSTERIOR,
        "joint": JOINT,
        "predict": PREDICT,
        "studio": STUDIO,
    },
    "look up": {
        "catalogue": CATALOGUE,
        "effects": EFFECTS,
        "settings": SETTINGS,
        "schema": Command("schema", "print the JSON schema of a document"),
    },
    "a simulator that has learned": {"scenes": SCENES, "runs": RUNS, "gns": GNS},
    "your shell": {"completion": Command("completion", "print the completion of your shell")},
}
"""The commands of `flowslide`, by the headings of its help."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run `flowslide`; the exit code, 0 for success."""
    return _run(build_parser(), _with_default(sys.argv[1:] if argv is None else list(argv)))


def build_parser() -> CommandParser:
    """The parser of `flowslide`; that of a command has its arguments once it is used."""
    parser = _Face(
        prog="flowslide",
        description="Back-analysis of the residual strength of liquefied soil from the runout of "
        "flow slides.",
    )
    version = "print the version"
    parser.add_argument("--version", action="version", version=_version(), help=version)
    _add(parser, {name: one for part in COMMANDS.values() for name, one in part.items()})
    return parser


def leaves() -> Iterator[tuple[str, Command]]:
    """Every command of `flowslide` with the words that name it."""
    for part in COMMANDS.values():
        for name, one in part.items():
            if isinstance(one, Group):
                yield from ((f"{name} {inner}", command) for inner, command in one.commands.items())
            else:
                yield name, one


class _Face(CommandParser):
    """The parser of `flowslide`, whose help lists the commands under headings."""

    def format_help(self) -> str:
        lines = [f"usage: {self.prog} COMMAND ...", "", self.description or ""]
        for heading, commands in COMMANDS.items():
            lines += ["", f"{heading}:"]
            for name, one in commands.items():
                lines.append(f"  {name:<11}{one.help}")
                if isinstance(one, Group):
                    lines.append(f"  {'':<11}({', '.join(one.commands)})")
        lines += ["", f"Options of a command: {self.prog} COMMAND --help", ""]
        return "\n".join(lines)


class _CommandParser(CommandParser):
    """The parser of one command, which takes its arguments from the module when it is used."""

    def __init__(self, *args: Any, command: Command, **keywords: Any) -> None:
        super().__init__(*args, **keywords)
        self._command: Command | None = command

    def complete(self) -> None:
        """Add the arguments of the command; once."""
        command, self._command = self._command, None
        if command is not None:
            module = import_module(f"flowslide.commands.{command.module}")
            self.description = module.DESCRIPTION
            module.add_arguments(self)
            needs = (command.extra, self.prog)
            self.set_defaults(handler=module.run, needs=needs, **command.defaults)

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """As `argparse`; the arguments of the command are added before."""
        self.complete()
        return super().parse_known_args(args, namespace)


def _add(parser: CommandParser, commands: Mapping[str, Command | Group]) -> None:
    """Add commands to a parser."""
    # A function in place of a class: which of two parsers it is depends on the command.
    maker: Any = _parser_of
    places = parser.add_subparsers(
        metavar="COMMAND", required=True, parser_class=maker, title="commands"
    )
    for name, one in commands.items():
        inner = places.add_parser(name, help=one.help, description=one.help, entry=one)
        if isinstance(one, Group):
            _add(inner, one.commands)


def _parser_of(*args: Any, entry: Command | Group, **keywords: Any) -> CommandParser:
    if isinstance(entry, Group):
        return CommandParser(*args, **keywords)
    return _CommandParser(*args, command=entry, **keywords)


def _run(parser: CommandParser, argv: Sequence[str] | None) -> int:
    arguments = parser.parse_args(argv)
    extra, command = arguments.needs
    if extra:
        require(extra, command)
    options.check(arguments)
    effects = getattr(arguments, "effect_files", ())
    measurements = getattr(arguments, "measurement_files", ())
    if not (effects or measurements):
        return arguments.handler(arguments) or 0
    from flowslide.run import own_code

    with own_code(effects, measurements):
        return arguments.handler(arguments) or 0


def _with_default(argv: list[str]) -> list[str]:
    """The words typed, with the sub-command that is meant where a group has one by default."""
    groups = {name: one for part in COMMANDS.values() for name, one in part.items()}
    group = groups.get(argv[0]) if argv else None
    if isinstance(group, Group) and group.default is not None and len(argv) > 1:
        if argv[1] not in (*group.commands, "-h", "--help"):
            return [argv[0], group.default, *argv[1:]]
    return argv


def _version() -> str:
    import pipeline

    return f"flowslide {pipeline.__version__}"
