"""The command that runs the cases, its records, and the page made of them."""

from __future__ import annotations

import math
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.generated_pages import Measured
from benchmarks.verification import __main__ as command
from benchmarks.verification import document, record
from benchmarks.verification.rows import Row
from pipeline.cli import InputError

GOOD = Row("first", "speed", 1.01, 1.0, 0.02, "m/s", note="a note")
BAD = Row("second", "length", np.float64(1.5), 1.0, 0.1, "m", absolute=True)
BOUND = Row("first", "noise", 0.3, 0.5, 0.0, bound=True)


@pytest.fixture
def place(tmp_path, monkeypatch):
    """An empty place for results and documents, and three cases that take no time."""
    monkeypatch.setattr(record, "RESULTS", tmp_path / "results.json")
    monkeypatch.setattr(document, "PAGE", tmp_path / "page.md")
    monkeypatch.setattr(document, "PICTURES", tmp_path / "pictures")
    monkeypatch.setattr(document, "explanation", lambda file: f"What {file.stem} is.")
    monkeypatch.setattr(record, "case_names", lambda: ["first", "second", "broken"])
    monkeypatch.setattr(record, "sources_hash", lambda name: f"hash of {name}")
    summary, cases = (
        f"<!-- {part}: begin -->\n<!-- {part}: end -->"
        for part in (document.SUMMARY, document.SECTIONS)
    )
    markers = f"{summary}\nkept\n{cases}"
    (tmp_path / "page.md").write_text(f"# Page\n{markers}\nend\n")
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
    return SimpleNamespace(folder=tmp_path, calls=calls)


def test_good_rows_end_with_0_and_are_stored(place):
    assert command.main(["first"]) == 0
    stored = record.read_records()
    assert record.rows_of(stored["first"]) == [GOOD, BOUND]
    assert record.passed(stored["first"])
    assert stored["first"]["packages"].keys() == {"python", "numpy", "taichi"}
    page = (place.folder / "page.md").read_text()
    assert "What first is." in page and "images/verification/first.png" in page
    assert "| speed (a note) | 1.01 m/s | 1 m/s | +1 % | ± 2 % | pass |" in page
    assert "| noise | 0.3 |  |  | ≤ 0.5 | pass |" in page
    assert page.startswith("# Page\n") and "\nkept\n" in page and page.endswith("\nend\n")


def test_a_row_outside_its_tolerance_ends_with_1_and_is_named(place):
    assert command.main(["second"]) == 1
    page = (place.folder / "page.md").read_text()
    assert "| [Case second](#second) | 1 | 0 | length |" in page
    assert "| length | 1.5 m | 1 m | +0.5 m | ± 0.1 m | **FAIL** |" in page


def test_a_case_that_breaks_keeps_the_others(place, capsys):
    assert command.main([]) == 1
    stored = record.read_records()
    assert list(stored) == ["broken", "first", "second"]
    assert stored["broken"]["error"] == "RuntimeError: the grid is on fire"
    assert not record.passed(stored["broken"])
    assert "did not run to its end: RuntimeError" in (place.folder / "page.md").read_text()
    assert "FAIL" in capsys.readouterr().out


def test_one_case_leaves_the_records_of_the_others(place):
    command.main([])
    before = record.read_records()
    command.main(["first"])
    after = record.read_records()
    assert after["second"] == before["second"] and after["broken"] == before["broken"]


def test_a_case_that_is_no_longer_there_leaves_the_table(place, monkeypatch):
    command.main([])
    monkeypatch.setattr(record, "case_names", lambda: ["first"])
    command.main(["first"])
    assert list(record.read_records()) == ["first"]


def test_resume_runs_what_is_missing_broken_or_changed(place, monkeypatch):
    command.main([])
    place.calls.clear()
    command.main(["--resume"])
    assert [name for name, _, _ in place.calls] == ["broken"]
    monkeypatch.setattr(record, "sources_hash", lambda name: "changed")
    place.calls.clear()
    command.main(["--resume", "first"])
    assert [name for name, _, _ in place.calls] == ["first"]


def test_quick_stores_nothing_and_draws_only_where_told(place):
    assert command.main(["first", "--quick"]) == 0
    assert place.calls[-1] == ("first", None, True)
    command.main(["first", "--quick", "--out", str(place.folder / "here")])
    assert (place.folder / "here" / "first.png").exists()
    assert not record.RESULTS.exists()


def test_unknown_case_is_refused_with_the_known_ones(place):
    with pytest.raises(InputError, match="case 'third' is unknown: allowed are first, second"):
        command.main(["third"])


def test_numbers_that_are_none_are_kept_and_pass_nothing(place):
    rows = [Row("first", "x", math.nan, 1.0, 0.1), Row("first", "y", math.nan, 1.0, 0, bound=True)]
    entry = record.make_record("first", Measured("First", rows, 1.0, ""))
    record.write_records({"first": entry})
    read = record.rows_of(record.read_records()["first"])
    assert all(math.isnan(row.measured) and not row.passed for row in read)


def test_cases_are_the_files_with_a_title_and_a_run(tmp_path):
    (tmp_path / "one.py").write_text('TITLE = "One"\ndef run(folder, quick=False): return []\n')
    (tmp_path / "two.py").write_text('TITLE: str = "Two"\ndef run(folder, quick=False): ...\n')
    (tmp_path / "helper.py").write_text("def run(): ...\n")
    assert record.case_names(tmp_path) == ["one", "two"]


def test_every_case_explains_itself():
    for name in record.case_names():
        assert len(document.explanation(record.HERE / f"{name}.py").split()) > 30, (
            f"{name}: a docstring of a few lines"
        )


def test_page_is_what_its_records_make_it():
    stored = record.read_records()
    page = document.PAGE.read_text(encoding="utf-8")
    remedy = "out of date: python -m benchmarks.verification --page"
    assert document.page_text(stored, page) == page, f"docs/records/verification.md {remedy}"


def test_page_without_markers_is_refused():
    with pytest.raises(InputError, match="the lines <!-- summary: begin --> and .* are missing"):
        document.between("no markers", document.SUMMARY, "new")
