"""`python -m benchmarks.gpu`: the command line; see README.md."""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from pathlib import Path

from benchmarks.gpu.record import Record
from benchmarks.gpu.stages import REHEARSE, STAGES, Context, run_stage, work
from pipeline.cli import CommandParser, InputError, base_parser, main_exit

BUDGET_S = 480.0


def main(argv: Sequence[str] | None = None) -> int:
    """Measure, or be the process of one stage."""
    arguments = _parser().parse_args(argv)
    device = arguments.device or ("cpu" if arguments.rehearse else "cuda")
    made = {"device": device, "rehearsal": arguments.rehearse}
    if arguments.stage:
        stage = STAGES[arguments.stage]
        context = Context(
            device,
            arguments.rehearse,
            Record(arguments.out, made),
            time.monotonic() + arguments.seconds,
        )
        return work(stage, context, stage.measurements())
    if not arguments.budget > 0.0:
        raise InputError(f"--budget {arguments.budget:g}: must be greater than 0")
    return _measure(arguments, device, made)


def _measure(arguments: argparse.Namespace, device: str, made: dict) -> int:
    """All stages that are asked for, and their table."""
    until = time.monotonic() + arguments.budget
    record = Record(arguments.out, made)
    record.forget_failures()
    record.add("", "", [])
    options = ["--out", str(arguments.out), "--device", device]
    options += [REHEARSE] if arguments.rehearse else []
    for name in arguments.stages:
        left = until - time.monotonic()
        run_stage(STAGES[name], lambda: Record(arguments.out, made), left, options)
    record = Record(arguments.out, made)
    print(record.table())
    return 0


def _parser() -> CommandParser:
    parser = base_parser("python -m benchmarks.gpu", "Everything that a GPU has to tell.")
    parser.add_argument(REHEARSE, action="store_true", help="all of it in miniature, on a CPU")
    parser.add_argument(
        "--stages", nargs="+", choices=STAGES, default=list(STAGES), help="default: all"
    )
    parser.add_argument("--device", choices=("cuda", "cpu"), help="default: cuda; a rehearsal: cpu")
    parser.add_argument(
        "--out", type=Path, default=Path("results/gpu.json"), metavar="FILE", help="of all rows"
    )
    parser.add_argument(
        "--budget", type=float, default=BUDGET_S, metavar="S", help="time for all; default: 480"
    )
    parser.add_argument("--stage", choices=STAGES, help=argparse.SUPPRESS)
    parser.add_argument("--seconds", type=float, default=0.0, help=argparse.SUPPRESS)
    return parser


if __name__ == "__main__":
    main_exit(main)
