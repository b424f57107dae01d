"""How often the diagnosis is right, and how often it is wrong, on blind cases of the prototype.

    python -m benchmarks.diagnosis_prototype --cases 40 --kinds null single

takes about two seconds a case. A case whose effect no amplitude makes visible is left out and
counted as such. By lambda, the noise-free misfit that the hidden effect leaves:

- named: the verdict names the hidden effects, and those alone;
- false: it names others, or more, or fewer, as identified;
- in the set: the explanations that have 90 % of the probability hold the hidden one;
- amplitude, S_r: their 95 % interval holds the truth, where the hidden effects are named.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass

from benchmarks.diagnosis_prototype.cases import BINS, Case, Setting, make_case
from benchmarks.hidden_effects.scoring.intervals import Share
from diagnosis.loop import diagnose
from diagnosis.options import Options
from diagnosis.verdict.verdict import Verdict
from pipeline.cli import InputError, base_parser, main_exit

KINDS = ("null", "single", "pair", "outside")
NORMAL_95 = 1.96
COLUMNS = ("named", "false", "in the set", "amplitude", "S_r")


@dataclass(frozen=True)
class Outcome:
    """One case and what was said of it; None: not asked of it."""

    case: Case
    verdict: str
    said: frozenset[str]
    named: bool
    false: bool
    in_the_set: bool | None
    amplitude: bool | None
    s_r: bool | None


def main(argv: Sequence[str] | None = None) -> int:
    """Make cases, diagnose them, print the table."""
    parser = base_parser("python -m benchmarks.diagnosis_prototype", __doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=40, metavar="N", help="of each kind")
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=KINDS, help="default: all")
    parser.add_argument("--noise", type=float, default=1.0, help="of a run, by its points")
    parser.add_argument("--each", action="store_true", help="print every case")
    arguments: argparse.Namespace = parser.parse_args(argv)
    if arguments.cases < 1:
        raise InputError(f"--cases {arguments.cases}: at least 1")
    for kind in arguments.kinds:
        outcomes, invisible = study(kind, arguments.cases, Setting(noise=arguments.noise))
        if arguments.each:
            for one in outcomes:
                print(line(one))
        print(table(kind, outcomes, invisible), flush=True)
    return 0


def study(kind: str, count: int, setting: Setting) -> tuple[list[Outcome], int]:
    """Diagnose the first cases of a kind; also how many have no visible effect."""
    cases = [make_case(kind, number, setting) for number in range(count)]
    visible = [case for case in cases if case.effects or kind == "null"]
    found = [
        outcome(case, diagnose(case.model, Options(synthetic=True), case=case.name, title=""))
        for case in visible
    ]
    return found, len(cases) - len(visible)


def outcome(case: Case, verdict: Verdict) -> Outcome:
    """Compare a verdict with the truth.

    What is outside the library cannot be named: there the right answer is `unknown_effect`.
    """
    said = frozenset(effect.name for effect in verdict.answer.effects)
    truth = frozenset() if case.kind == "outside" else frozenset(case.effects)
    claims = verdict.verdict in ("identified", "ambiguous")
    named = said == truth and verdict.verdict != "unknown_effect"
    if case.kind == "outside":
        named = verdict.verdict == "unknown_effect"
    elif case.kind == "null":
        named = not claims and verdict.verdict != "unknown_effect"
    sets = [frozenset(one.names) for one in verdict.answer.set_90]
    both = bool(truth) and claims and said == truth
    held = [low <= case.effects[e.name] <= high
            for e in verdict.answer.effects if both
            for low, high in [e.interval_95]]  # fmt: skip
    strength, std = verdict.final.values["S_r"], verdict.final.std["S_r"]
    return Outcome(
        case=case,
        verdict=verdict.verdict,
        said=said,
        named=named,
        false=verdict.verdict == "identified" and (said != truth or case.kind == "outside"),
        in_the_set=truth in sets if truth else None,
        amplitude=all(held) if both else None,
        s_r=abs(strength - case.values[0]) <= NORMAL_95 * std if both or not case.effects else None,
    )


def table(kind: str, outcomes: Sequence[Outcome], invisible: int) -> str:
    """Shares by lambda, with their 95 % intervals."""
    rows = [f"{kind}: {len(outcomes)} cases, {invisible} left out: no amplitude could be seen"]
    bins = [(0.0, float("inf"))] if kind == "null" else [*BINS, (0.0, float("inf"))]
    width = 26
    rows.append(f"{'lambda':<12}" + "".join(f"{name:<{width}}" for name in COLUMNS))
    for low, high in bins:
        some = [one for one in outcomes if low <= one.case.detectability < high]
        cells = [
            _share([one.named for one in some]),
            _share([one.false for one in some]),
            _share([one.in_the_set for one in some]),
            _share([one.amplitude for one in some]),
            _share([one.s_r for one in some]),
        ]
        label = "all" if low == 0.0 else f"{low:g} to {high:g}"
        rows.append(f"{label:<12}" + "".join(f"{cell:<{width}}" for cell in cells))
    return "\n".join(rows) + "\n"


def _share(held: Sequence[bool | None]) -> str:
    asked = [one for one in held if one is not None]
    return Share(sum(asked), len(asked)).words


def line(one: Outcome) -> str:
    """A case in a line."""
    hidden = ", ".join(f"{name} {a:.3g}" for name, a in one.case.effects.items()) or "nothing"
    mark = "right" if one.named else ("FALSE" if one.false else "-")
    said = ", ".join(sorted(one.said)) or "nothing"
    return (
        f"{one.case.name:<12} {one.case.survey:<8} lambda {one.case.detectability:6.1f}  {hidden} "
        f"-> {one.verdict}: {said}  {mark}"
    )


if __name__ == "__main__":
    main_exit(main)
