"""Every set that has been opened, a row each: the table of docs/records/hidden-effects.md.

In: the records that are kept. Out: what was asked of the diagnosis and what it said, counted alike
for slides by the judge's own solver and by other codes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from benchmarks.generated_pages import RECORDS, ROOT, table
from benchmarks.hidden_effects.making.benchmark import load_benchmark
from benchmarks.hidden_effects.scoring.by_other_codes import gives_name, is_right
from benchmarks.hidden_effects.scoring.digest import METHOD
from benchmarks.hidden_effects.scoring.opened import judged, load_rows
from benchmarks.hidden_effects.scoring.score import Judged

PAGE = RECORDS / "hidden-effects.md"
FOLDER = ROOT / "benchmarks" / "hidden_effects"


@dataclass(frozen=True)
class OpenedSet:
    """A set that has been opened.

    Attributes:
        words: its name; slides: whose they are.
        plan, record: files in `benchmarks/hidden_effects`, without their ends.
        commit: of the method that judged it.
    """

    words: str
    slides: str
    plan: str
    record: str
    commit: str

    def cases(self) -> list[Judged]:
        """Its slides with what the method said of each."""
        benchmark = load_benchmark(FOLDER / f"{self.plan}.yaml")
        return judged(load_rows(FOLDER / f"{self.record}.json"), benchmark, METHOD)


SETS = (
    OpenedSet("physics", "own solver", "benchmark", "results", "32d0336"),
    OpenedSet("all families", "own solver", "all_families", "all_families_results", "2e1651c"),
    OpenedSet("first", "SPH, newton", "foreign", "foreign_first_results", "fa354f6"),
    OpenedSet("second", "SPH, newton", "foreign", "foreign_results", "e35be98"),
    OpenedSet("third", "SPH", "foreign_third", "foreign_third_results", "d9e6cc4"),
    OpenedSet("fourth", "SPH", "foreign_fourth", "foreign_fourth_results", "a166415"),
    OpenedSet("fifth", "SPH", "foreign_fifth", "foreign_fifth_results", "59c55b9"),
    OpenedSet("sixth", "SPH", "foreign_sixth", "foreign_sixth_results", "05a9d15"),
    OpenedSet("seventh", "SPH", "foreign_seventh", "foreign_seventh_results", "d6d852f"),
    OpenedSet("pore water", "own solver", "pore_water", "pore_water_results", "7329293"),
    OpenedSet(
        "pore water, second",
        "own solver",
        "pore_water_second",
        "pore_water_second_results",
        "72891d84",
    ),
    OpenedSet(
        "pore water, third",
        "own solver",
        "pore_water_third",
        "pore_water_third_results",
        "21720d92",
    ),
)
HEADER = (
    "set", "slides by", "cases", "nulls: alarm, name", "single things named right",
    "right, of the names given", "strangers explained away", "S_r within 2 std: right name",
    "null", "anything hidden", "judged by",
)  # fmt: skip


def sets_table() -> str:
    """The table."""
    rows = [row(one) for one in SETS]
    return table(HEADER, rows, "llrrrrrrrrl")


def row(opened: OpenedSet) -> list[str]:
    """The row of a set."""
    cases = opened.cases()

    def of(*kinds: str) -> list[Judged]:
        return [one for one in cases if one.truth["kind"] in kinds]

    nulls, singles = of("null"), of("single")
    given = [one for one in (*singles, *nulls) if gives_name(one)]
    alarms, accused = (
        _count(nulls, test) for test in (lambda c: c.alarmed, lambda c: c.attributed)
    )
    return [
        opened.words, opened.slides, str(len(cases)), f"{alarms}, {accused} of {len(nulls)}",
        _of(singles, is_right), _of(given, is_right),
        _of(of("outside"), lambda one: one.explained_away), *(
            _of(some, lambda one: one.strength_within)
            for some in ([one for one in singles if is_right(one)], nulls,
                         of("single", "pair", "outside"))
        ), f"`{opened.commit}`",
    ]  # fmt: skip


def _count(cases: Sequence[Judged], test: Callable[[Judged], bool]) -> int:
    return sum(map(test, cases))


def _of(cases: Sequence[Judged], test: Callable[[Judged], bool]) -> str:
    return f"{_count(cases, test)} of {len(cases)}" if cases else "-"
