"""What the first pages say of Lower San Fernando is what a run of today gives."""

from __future__ import annotations

import json
import re

import pytest

from flowslide.command_line import main

FIRST = r"S_r = ([\d.]+) kPa, between .*?; ([\d.]+) of the vertical effective stress"
ANSWER = "docs/start/first-answer.md"
AGAIN = {
    ANSWER: r"S_r is ([\d.]+) ± [\d.]+ kPa, and ([\d.]+) ± ",
    "case_histories/lower_san_fernando/README.md": (
        r"\*\*S_r ([\d.]+) \+- .*?\*\*.*?S_r/sigma'_v0 ([\d.]+) "
    ),
}
MISSED = {
    "freeboard": r"\(([\d.]+) m predicted, 1\.5 ± 0\.5 m measured\)",
    "crest": r"place sinks by (\d+) m \(20 m measured\)",
    "duration": r"the slide takes (\d+) s \(40 s\)",
}


def numbers(root, page: str, pattern: str) -> list[float]:
    """The numbers of a sentence, wherever its lines end."""
    return [
        float(one)
        for one in re.search(pattern, " ".join((root / page).read_text().split())).groups()
    ]


@pytest.mark.parametrize("page", AGAIN)
def test_other_pages_say_the_same(root, page):
    assert numbers(root, page, AGAIN[page]) == numbers(root, "README.md", FIRST)


@pytest.mark.slow
def test_a_run_gives_it(root, tmp_path):
    """Without variants, which widen the interval and leave the strength."""
    options = ("--quick", "--report", "none", "--quiet", "--out", str(tmp_path))
    assert main(["invert", "lower_san_fernando", *options]) == 0
    found = json.loads((tmp_path / "result.json").read_text())
    (strength,) = found["answer"]["parameters"]
    said, ratio = numbers(root, "README.md", FIRST)
    assert strength["value"] == pytest.approx(said, abs=0.15)
    assert strength["ratio"] == pytest.approx(ratio, abs=0.001)
    read = {one["name"]: one["predicted"] for one in found["measurements"]}
    for name, pattern in MISSED.items():
        (words,) = numbers(root, ANSWER, pattern)
        assert read[name] == pytest.approx(words, abs=0.15 if name == "freeboard" else 0.6), name
