"""Pages as PDF: printed where a browser is installed, and one clear line where none is."""

from __future__ import annotations

import os
import re
import stat

import pytest

import flowslide
from diagnosis.verdict.verdict import save_document
from flowslide.command_line import main
from inversion.back_analysis.result import save_result
from report import pdf
from report.page import PageSection, Paragraph, write_page
from report.table import Table
from tests.diagnosis.verdict_case import identified
from tests.inversion.report_case import full

printing = pytest.mark.skipif(
    pdf.browser() is None and not os.environ.get("CI"),
    reason="there is no chromium on this machine",
)
A4 = (595, 842)


def pages(data: bytes) -> int:
    return len(re.findall(rb"/Type\s*/Page\b(?!s)", data))


@pytest.fixture
def page(tmp_path):
    path = tmp_path / "page.html"
    write_page(path, 'A "quoted" </style> \\ title', [PageSection("One", [Paragraph("It ran.")])])
    return path


def test_a_title_at_the_foot_is_text_and_ends_nothing(page):
    text = page.read_text()
    style = text[text.index("<style>") : text.index("</style>")]
    assert "FOOT" not in style and "@bottom-right" in style
    (foot,) = re.findall(r'content: "((?:\\[0-9a-f]{6})+)"', style)
    letters = "".join(chr(int(code, 16)) for code in foot.split("\\")[1:])
    assert letters == 'A "quoted" </style> \\ title'


@printing
@pytest.mark.slow
def test_a_page_is_printed_on_a4(page):
    printed = flowslide.write_pdf(page)
    data = printed.read_bytes()
    assert printed == page.with_suffix(".pdf") and data.startswith(b"%PDF-") and pages(data) == 1
    box = re.search(rb"/MediaBox\s*\[0 0 ([\d.]+) ([\d.]+)\]", data)
    assert tuple(round(float(side)) for side in box.groups()) == A4
    assert [path.name for path in sorted(page.parent.iterdir())] == ["page.html", "page.pdf"]


@printing
@pytest.mark.slow
def test_a_short_table_is_not_cut_and_a_long_one_is(tmp_path):
    rows = [[f"row {k}", float(k)] for k in range(26)]
    short = [Table(["a", "b"], rows)] * 3
    counts = []
    for parts in (short, [Table(["a", "b"], rows * 3)]):
        write_page(tmp_path / "page.html", "x", [PageSection("Tables", parts)])
        counts.append(pages(pdf.write_pdf(tmp_path / "page.html").read_bytes()))
    # Two of the short ones do not fit a page, so each has one; the same rows at a stretch fill two.
    assert counts == [3, 2]


@printing
@pytest.mark.slow
def test_the_command_prints_the_report_it_writes(tmp_path, capsys):
    save_result(full(), tmp_path)
    assert main(["report", str(tmp_path), "--pdf"]) == 0
    assert f"wrote {tmp_path / 'report.pdf'}" in capsys.readouterr().out
    assert pages((tmp_path / "report.pdf").read_bytes()) > 3


def test_without_a_browser_there_is_one_line(page, monkeypatch):
    monkeypatch.setattr(pdf, "BROWSERS", ("no-such-browser",))
    with pytest.raises(flowslide.InputError, match="Chromium or Chrome") as error:
        flowslide.write_pdf(page)
    assert "\n" not in str(error.value)
    with pytest.raises(flowslide.InputError, match="no such page"):
        flowslide.write_pdf(page.parent / "none.html")


def test_a_browser_that_fails_is_quoted(page, monkeypatch):
    broken = page.parent / "broken"
    broken.write_text("#!/bin/sh\necho first >&2\necho no screen >&2\nexit 3\n")
    broken.chmod(broken.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setattr(pdf, "BROWSERS", (str(broken),))
    with pytest.raises(flowslide.WorkFailed, match="no screen"):
        flowslide.write_pdf(page)
    assert not page.with_suffix(".pdf").exists()


def test_the_command_takes_a_diagnosis_as_well(tmp_path, capsys):
    verdict = identified()
    save_document(verdict, tmp_path / "verdict.json")
    assert main(["report", str(tmp_path)]) == 0
    said = capsys.readouterr().out
    assert said.startswith("IDENTIFIED.") and f"wrote {tmp_path / 'report.html'}" in said
    assert "Reviewer" in (tmp_path / "report.html").read_text()
