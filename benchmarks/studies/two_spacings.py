"""A back-analysis at two spacings against the slow way, number by number, and the limit of cells.

    python -m benchmarks.studies.two_spacings [--cases lower_san_fernando la_marquesa] [--page]

Each case is solved with the default settings (what changes the answer by coarse runs) and with
every run at the spacing of the answer. Every number of the fast result is compared with that of the
slow one, in its standard deviations. Then the strength of the first case is found at several
spacings, with and without the extrapolation to small cells. Runs are kept in
`results/benchmarks/two_spacings`, so a study that was stopped resumes; the figures are kept in
`two_spacings.json` and shown on `docs/records/numerical-choices.md`, which `--page` alone renews.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.generated_pages import RECORDS, ROOT, renew, table
from geometry.case import load_case
from inversion.back_analysis.back_analysis import BackAnalysis
from inversion.back_analysis.case import inversion_case
from inversion.back_analysis.result import Result
from inversion.engines.run_store import RunStore
from pipeline.config import load_config
from pipeline.files import read_json, write_json
from pipeline.manifest import code_version

RECORD = Path(__file__).with_suffix(".json")
PAGE = RECORDS / "numerical-choices.md"
FOLDER = ROOT / "results/benchmarks/two_spacings"
CASES = ("lower_san_fernando", "la_marquesa")
#: Spacings at which the strength of the first case is found, over its own.
REFINED = (2.0, 1.5, 1.0, 0.75, 0.5)
#: Its bars stand at the coarse spacing, and say so.
NO_WATERFALL = "inversion.waterfall=false"
ANSWER_ALONE = (
    "inversion.starts=1", "inversion.noise_seeds=0", "inversion.variants=false",
    "inversion.sensitivities=false", NO_WATERFALL,
)  # fmt: skip
#: What a difference must stay below, in standard deviations.
BOUND = 1.0 / 3.0
#: Groups of numbers with a row of their own on the page.
SHOWN = ("answer", "standard deviation")

Compared = tuple[str, str, float, float, float]
"""Group, name, fast, slow, standard deviation."""


class CountedStore(RunStore):
    """Keeps runs, and counts those asked for by their spacing."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder, threads=1)
        self.asked: dict[str, float] = {}

    def fetch(self, wanted, readers=None):
        """The runs; see `RunStore`."""
        runs = super().fetch(wanted, readers)
        for (scene, settings), run in zip(wanted, runs, strict=True):
            self.asked[f"{scene.spacing:g} {id(run)} {settings.water}"] = scene.spacing
        return runs

    @property
    def by_spacing(self) -> dict[str, int]:
        """Different runs by spacing [m]."""
        spacings = list(self.asked.values())
        return {f"{one:g}": spacings.count(one) for one in sorted(set(spacings))}


def solve(case: str, kind: str, *overrides: str, spacing_m: float | None = None):
    """One back-analysis: its result, its runs by spacing."""
    settings = load_config(None, list(overrides))
    asked = inversion_case(load_case(ROOT / "case_histories" / case, settings), spacing_m=spacing_m)
    store = CountedStore(FOLDER / case / kind)
    result = BackAnalysis(asked, store, say=lambda line: print(f"{case}, {kind}: {line}")).run()
    return result, store.by_spacing


def numbers(fast: Result, slow: Result) -> Iterator[Compared]:
    """Every number of two results of one question."""
    stds = {p.name: p.std_total for p in slow.answer.parameters}
    for one, own in zip(fast.answer.parameters, slow.answer.parameters, strict=True):
        std = own.std_total
        yield "answer", one.name, one.value, own.value, std
        if own.ratio is not None:
            yield "answer", f"{one.name}: ratio", one.ratio, own.ratio, own.ratio_std
        for end, mine, theirs in zip(
            ("low", "high"), one.interval_95, own.interval_95, strict=True
        ):
            yield "95 % interval", f"{one.name}: {end}", mine, theirs, std
        yield "standard deviation", one.name, one.std_total, own.std_total, std
        yield "standard deviation", f"{one.name}: survey", one.std_data, own.std_data, std
        for source, value in own.std_by_source.items():
            mine = one.std_by_source.get(source, np.nan)
            yield "standard deviation", f"{one.name}: {source}", mine, value, std
        if own.equally_good_range and one.equally_good_range:
            for mine, theirs in zip(one.equally_good_range, own.equally_good_range, strict=True):
                yield "equally good", one.name, mine, theirs, std
    measured = {m.name: m for m in slow.measurements if m.role != "constructed"}
    predicted = {m.name: m.predicted for m in fast.measurements}
    for name, m in measured.items():
        yield "predictions", name, predicted[name], m.predicted, m.std
    for one, own in zip(fast.variants, slow.variants, strict=True):
        for name, std in stds.items():
            yield "variants", f"{own.name}: {name}", one.values[name], own.values[name], std
        for name, value in own.predicted.items():
            if name in measured:
                mine, std = one.predicted.get(name, np.nan), measured[name].std
                yield "variants: predictions", f"{own.name}: {name}", mine, value, std
    for one, own in zip(fast.sensitivities, slow.sensitivities, strict=True):
        for mine, theirs in zip(one.sides, own.sides, strict=True):
            for name, std in stds.items():
                where = f"{own.name}, {theirs.words}: {name}"
                yield "changes", where, mine.change[name], theirs.change[name], std
    for one, own in zip(fast.starts[1:], slow.starts[1:], strict=True):
        for name, std in stds.items():
            yield "other starts", name, one.answer[name], own.answer[name], std


def compared(fast: Result, slow: Result) -> list[dict[str, Any]]:
    """The comparison by groups: how many numbers, root mean square and largest difference."""
    groups: dict[str, list[Compared]] = {}
    for row in numbers(fast, slow):
        groups.setdefault(row[0], []).append(row)
    found = []
    for name, rows in groups.items():
        off = np.array([abs(mine - theirs) / std for _, _, mine, theirs, std in rows])
        worst = rows[int(np.argmax(off))]
        found.append(
            {
                "group": name,
                "numbers": len(rows),
                "rms": float(np.sqrt(np.mean(off**2))),
                "largest": float(off.max()),
                "beyond": int((off > BOUND).sum()),
                "where": worst[1],
                "fast": worst[2],
                "slow": worst[3],
            }
        )
    return found


def comparison(case: str) -> dict[str, Any]:
    """A case both ways."""
    slow, slow_runs = solve(case, "slow", "inversion.coarse_factor=1", NO_WATERFALL)
    fast, fast_runs = solve(case, "fast", NO_WATERFALL)
    return {
        "spacing_m": fast.spacing_m,
        "coarse_spacing_m": fast.coarse_spacing_m,
        "runs": {"fast": fast_runs, "slow": slow_runs},
        "answers": [
            {"name": one.label, "unit": one.unit, "fast": [one.value, one.std_total],
             "slow": [own.value, own.std_total]}
            for one, own in zip(fast.answer.parameters, slow.answer.parameters, strict=True)
        ],
        "groups": compared(fast, slow),
        "code_version": code_version(),
    }  # fmt: skip


def refinement(case: str) -> list[dict[str, float]]:
    """The strength at several spacings, found from a coarse answer (the finest by few runs)."""
    own = inversion_case(load_case(ROOT / "case_histories" / case, load_config(None))).own_spacing_m
    found = []
    for factor in REFINED:
        result, _ = solve(case, "cells", *ANSWER_ALONE, spacing_m=own * factor)
        strength = result.answer.parameters[0]
        toe = next(m for m in result.measurements if m.role == "fitted")
        slope = result.answer.derivative[toe.name][strength.name]
        # To the digit: what the fit still lacks, by the derivative.
        value = strength.value + (toe.measured - toe.predicted) / slope
        found.append({"spacing_m": own * factor, "value": value})
    return found


def work(runs: dict[str, int], spacing_m: float) -> float:
    """Work in units of a run at the spacing of the answer: as 1 / spacing^3."""
    return sum(count * (spacing_m / float(spacing)) ** 3 for spacing, count in runs.items())


def shown_groups(groups: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The answer, what has a number beyond the bound, and all others as one."""
    shown = [g for g in groups if g["beyond"] or g["group"] in SHOWN]
    others = [g for g in groups if g not in shown]
    numbers = sum(g["numbers"] for g in others)
    rms = (sum(g["numbers"] * g["rms"] ** 2 for g in others) / numbers) ** 0.5
    largest = max(g["largest"] for g in others)
    joined = {"group": "all others", "numbers": numbers, "rms": rms, "largest": largest}
    return [*shown, {**joined, "beyond": 0}]


def page(record: dict[str, Any]) -> dict[str, str]:
    """The generated parts of the page."""
    parts = []
    for case, one in record.get("cases", {}).items():
        title = case.replace("_", " ").title()
        answers = "; ".join(
            f"{a['name']} {a['fast'][0]:.2f} ± {a['fast'][1]:.2f} {a['unit']} (slow: "
            f"{a['slow'][0]:.2f} ± {a['slow'][1]:.2f})"
            for a in one["answers"]
        )
        runs = [
            f"{kind}: " + ", ".join(f"{n} runs at {s} m" for s, n in one["runs"][kind].items())
            + f", the work of {work(one['runs'][kind], one['spacing_m']):.0f} at "
            f"{one['spacing_m']:g} m"
            for kind in ("fast", "slow")
        ]  # fmt: skip
        rows = [
            [g["group"], str(g["numbers"]), f"{g['rms']:.3f}",
             f"**{g['largest']:.2f}**" if g["largest"] > BOUND else f"{g['largest']:.2f}",
             f"{g['where']}: {g['fast']:.3g}, slow {g['slow']:.3g}" if g["beyond"] else ""]
            for g in shown_groups(one["groups"])
        ]  # fmt: skip
        header = ["numbers of", "how many", "rms", "largest", "beyond 1/3"]
        parts.append(
            f"### {title}, {one['spacing_m']:g} and {one['coarse_spacing_m']:g} m\n\n{answers}.\n\n"
            f"{'; '.join(runs)}.\n\n{table(header, rows, 'lrrrl')}\n"
        )
    cells = record.get("cells", [])
    rows = []
    for number, one in enumerate(cells):
        double = next(
            (c for c in cells if abs(c["spacing_m"] - 2.0 * one["spacing_m"]) < 1e-9), None
        )
        limit = "" if double is None else f"{one['value'] ** 2 / double['value']:.2f}"
        change = (
            "" if number == 0 else f"{100 * (one['value'] / cells[number - 1]['value'] - 1):+.1f} %"
        )
        rows.append([f"{one['spacing_m']:g} m", f"{one['value']:.2f}", change, limit])
    header = ["points every", "S_r (kPa)", "change", "limit of small cells (kPa)"]
    return {"fidelity": "\n".join(parts), "cells": table(header, rows, "rrrr")}


def main() -> None:
    """Solve, compare, keep, and renew the page."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.studies.two_spacings", description=__doc__
    )
    parser.add_argument("--cases", nargs="*", choices=list(CASES), default=list(CASES))
    parser.add_argument("--cells", action="store_true", help="the spacings of the first case alone")
    parser.add_argument("--page", action="store_true", help="renew the page from what is kept")
    options = parser.parse_args()
    record = read_json(RECORD) if RECORD.is_file() else {"cases": {}}
    if not options.page:
        for case in () if options.cells else options.cases:
            record["cases"][case] = comparison(case)
            write_json(RECORD, record)
        if options.cells or CASES[0] in options.cases:
            record["cells"] = refinement(CASES[0])
            write_json(RECORD, record)
    renew(PAGE, **page(record))


if __name__ == "__main__":
    main()
