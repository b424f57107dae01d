"""The command that runs the cases, its records, and the page made of them."""

from __future__ import annotations

import math
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.generated_pages import around
from benchmarks.verification.rows import Row
from benchmarks.verification.study import Verification
from pipeline.cli import InputError

GOOD = Row("first", "speed", 1.01, 1.0, 0.02, "m/s", note="a note")
BAD = Row("second", "length", np.float64(1.5), 1.0, 0.1, "m", absolute=True)
BOUND = Row("first", "noise", 0.3, 0.5, 0.0, bound=True)


class Small(Verification):
    """The verification with three cases that take no time, in an empty place."""

    state_of_sources = "hash"

    def __init__(self, folder):
        self.folder_of_results, self.page = folder, folder / "verification.md"
        self.pictures = folder / "pictures"
        self.known = ["first", "second", "broken"]

    @property
    def results(self):
        return self.folder_of_results / "results.json"

    def names(self):
        return self.known

    def state(self, name):
        return {"sources": f"{self.state_of_sources} of {name}"}

    def explanation(self, name):
        return f"What {name} is."


@pytest.fixture
def place(tmp_path, monkeypatch):
    """A small study with its page, and the calls of its cases."""
    parts = [f"<!-- {name}: begin -->\n<!-- {name}: end -->" for name in ("summary", "cases")]
    (tmp_path / "verification.md").write_text(f"# Page\n{parts[0]}\nkept\n{parts[1]}\nend\n")
    calls = []

    def case(name, rows):
        def run(folder, quick=False):
            calls.append((name, folder, quick))
            if rows is None:
                raise RuntimeError("the grid\nis on fire")
            if folder is not None:
                (folder / f"{name}.png").write_bytes(b"picture")
            return rows

        module = SimpleNamespace(TITLE=f"Case {name}", run=run)
        monkeypatch.setitem(sys.modules, f"benchmarks.verification.{name}", module)

    case("first", [GOOD, BOUND])
    case("second", [BAD])
    case("broken", None)
    return SimpleNamespace(folder=tmp_path, calls=calls, study=Small(tmp_path))


def test_good_rows_end_with_0_and_are_stored(place):
    assert place.study.main(["first"]) == 0
    stored = place.study.read()
    assert place.study.rows_of(stored["first"]) == [GOOD, BOUND]
    assert not place.study.missed(stored["first"])
    assert stored["first"]["packages"].keys() == {"python", "numpy", "taichi"}
    page = (place.folder / "verification.md").read_text()
    assert "What first is." in page and "images/verification/first.png" in page
    assert "| noise | 0.3 |  |  | ≤ 0.5 | pass |" in page and "speed" not in page
    assert page.startswith("# Page\n") and "\nkept\n" in page and page.endswith("\nend\n")


def test_a_row_outside_its_tolerance_ends_with_1_and_is_named(place):
    assert place.study.main(["second"]) == 1
    page = (place.folder / "verification.md").read_text()
    assert "| [Case second](#second) | 1 | 0 | length |" in page
    assert "| length | 1.5 m | 1 m | +0.5 m | ± 0.1 m | **FAIL** |" in page


def test_the_page_has_the_misses_and_what_comes_closest_to_one(place, capsys):
    shares = (0.1, 0.9, 0.4, 0.8, 0.2)
    rows = [Row("first", f"used {share}", 1 + share * 0.02, 1.0, 0.02) for share in shares]
    place.study.keep("first", place.study.record("first", "First", [*rows, BAD], 1.0, ""))
    page = (place.folder / "verification.md").read_text()
    shown = [share for share in shares if f"| used {share} |" in page]
    assert shown == [0.9] and "**FAIL**" in page and "| 6 | 5 | length |" in page
    capsys.readouterr()
    assert place.study.main(["first", "--stored"]) == 0 and not place.calls
    printed = capsys.readouterr().out
    assert all(f"used {share}" in printed for share in shares)


def test_a_case_that_breaks_keeps_the_others(place, capsys):
    assert place.study.main([]) == 1
    stored = place.study.read()
    assert list(stored) == ["first", "second", "broken"]
    assert stored["broken"]["error"] == "RuntimeError: the grid is on fire"
    assert place.study.missed(stored["broken"])
    assert "did not run to its end: RuntimeError" in (place.folder / "verification.md").read_text()
    assert "FAIL" in capsys.readouterr().out


def test_one_case_leaves_the_records_of_the_others(place):
    place.study.main([])
    before = place.study.read()
    place.study.main(["first"])
    after = place.study.read()
    assert after["second"] == before["second"] and after["broken"] == before["broken"]


def test_a_case_that_is_no_longer_there_leaves_the_table(place):
    place.study.main([])
    place.study.known = ["first"]
    place.study.main(["first"])
    assert list(place.study.read()) == ["first"]


def test_resume_runs_what_is_missing_broken_or_changed(place):
    place.study.main([])
    place.calls.clear()
    place.study.main(["--resume"])
    assert [name for name, _, _ in place.calls] == ["broken"]
    place.study.state_of_sources = "changed hash"
    place.calls.clear()
    place.study.main(["--resume", "first"])
    assert [name for name, _, _ in place.calls] == ["first"]


def test_quick_stores_nothing_and_draws_only_where_reported(place):
    assert place.study.main(["first", "--quick"]) == 0
    assert place.calls[-1] == ("first", None, True)
    place.study.main(["first", "--quick", "--out", str(place.folder / "here")])
    assert (place.folder / "here" / "first.png").exists()
    assert not place.study.results.exists()


def test_unknown_case_is_refused_with_the_known_ones(place):
    with pytest.raises(InputError, match="case 'third' is unknown: allowed are first, second"):
        place.study.main(["third"])


def test_numbers_that_are_none_are_kept_and_pass_nothing(place):
    rows = [Row("first", "x", math.nan, 1.0, 0.1), Row("first", "y", math.nan, 1.0, 0, bound=True)]
    entry = place.study.record("first", "First", rows, 1.0, "")
    place.study.keep("first", entry)
    read = place.study.rows_of(place.study.read()["first"])
    assert all(math.isnan(row.measured) and not row.passed for row in read)


def test_cases_are_the_files_with_a_title_and_a_run(tmp_path, monkeypatch):
    (tmp_path / "one.py").write_text('TITLE = "One"\ndef run(folder, quick=False): return []\n')
    (tmp_path / "two.py").write_text('TITLE: str = "Two"\ndef run(folder, quick=False): ...\n')
    (tmp_path / "noise.py").write_text("def run(): ...\n")
    monkeypatch.setattr(Verification, "folder", tmp_path)
    assert Verification().names() == ["one", "two"]


def test_every_case_explains_itself():
    study = Verification()
    for name in study.names():
        assert len(study.explanation(name).split()) > 30, f"{name}: a docstring of a few lines"


def test_page_is_what_its_records_make_it(tmp_path):
    study, copy = Verification(), Verification()
    copy.page = tmp_path / study.page.name
    kept = study.page.read_text(encoding="utf-8")
    copy.page.write_text(kept, encoding="utf-8")
    copy.write_pages(study.read())
    remedy = "out of date: python -m benchmarks.generated_pages"
    assert copy.page.read_text(encoding="utf-8") == kept, remedy


@pytest.mark.parametrize(
    "text",
    ["no markers", "<!-- summary: end --><!-- summary: begin -->", "<!-- summary: begin -->"],
)
def test_page_without_markers_is_refused(tmp_path, text):
    page = tmp_path / "page.md"
    page.write_text(text)
    with pytest.raises(InputError, match="the lines <!-- summary: begin --> and .* are missing"):
        around(page, "summary")
