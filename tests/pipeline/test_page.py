"""The page holds everything it shows, and shows text as text."""

from __future__ import annotations

import base64
import re
from html.parser import HTMLParser

import pytest

from pipeline.cli import InputError
from report.page import KeyNumbers, PageSection, Paragraph, Picture, render_page, write_page
from report.table import Table

PIXEL = base64.b64decode(
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5ErkJggg=="
)
VOID = {"meta", "img", "br"}


class Outline(HTMLParser):
    """Checks that every element is closed, and collects the links to other files."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.links: list[str] = []

    def handle_starttag(self, tag, attributes):
        self.links += [value for key, value in attributes if key in {"src", "href"}]
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


@pytest.fixture
def picture(tmp_path):
    path = tmp_path / "pixel.png"
    path.write_bytes(PIXEL)
    return Picture(path, description='a "pixel"', caption="One pixel")


def test_page_is_whole_and_alone(picture, tmp_path):
    sections = [
        PageSection(
            "Runs", [Paragraph("All went well."), Table(["run", "m"], [["a", 1.25]], "Runout")]
        ),
        PageSection("Picture", [picture]),
    ]
    write_page(tmp_path / "page.html", "Results", sections, lead="53 m")
    text = (tmp_path / "page.html").read_text()
    outline = Outline()
    outline.feed(text)
    assert outline.open == []
    assert outline.links and all(link.startswith("data:") for link in outline.links)
    assert "url(" not in text and "@import" not in text
    assert "prefers-color-scheme: dark" in text and "@media print" in text


def test_text_is_shown_as_text():
    text = render_page(
        "<b>", [PageSection("<i>", [Paragraph("<script>"), Table(["<u>"], [["<a>"]])])]
    )
    body = re.sub(r"<style>.*</style>", "", text, flags=re.DOTALL)
    assert not re.search(r"<(b|i|script|u|a)>", body)


def test_a_film_is_a_film(tmp_path):
    (tmp_path / "a.mp4").write_bytes(b"film")
    assert "<video" in Picture(tmp_path / "a.mp4", description="a slide").html()


def test_key_numbers_are_text():
    text = KeyNumbers([("S_r", "21 < 22 kPa", "")]).html()
    assert "<dt>S_r</dt><dd>21 &lt; 22 kPa</dd>" in text


def test_numbers_and_gaps_in_a_table():
    text = Table(["a", "b", "c", "d"], [[1, 0.123456, None, float("nan")]]).html()
    assert '<td class="number">1</td><td class="number">0.1235</td>' in text
    assert text.count("&ndash;") == 2
    with pytest.raises(ValueError, match="a row has 1 cells"):
        Table(["a", "b"], [[1]]).html()


def test_what_cannot_be_shown_is_named(tmp_path):
    with pytest.raises(InputError, match="allowed are png"):
        Picture(tmp_path / "a.txt", description="").html()
    with pytest.raises(InputError, match=r"a\.png: cannot be read"):
        Picture(tmp_path / "a.png", description="").html()


def test_a_table_is_the_same_on_a_terminal():
    rows = [["00_base", "−1.5 ± 0.2", None, "as before"], ["weak", "12.25", None, ""]]
    lines = Table(["model", "S_r (°)", "none", "note"], rows, "σ'_v0").text().splitlines()
    assert lines == [
        "sigma'_v0",
        "model      S_r (deg)  note",
        "00_base  -1.5 +- 0.2  as before",
        "weak           12.25",
    ]
    assert Table(["a"], []).text() == ""


def test_a_number_keeps_its_unit_on_one_line():
    text = Paragraph("27.5 ± 1.6 kPa on 3 m").html().replace("\N{NO-BREAK SPACE}", "_")
    assert text == "<p>27.5_±_1.6_kPa on 3_m</p>"
