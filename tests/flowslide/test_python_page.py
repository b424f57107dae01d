"""The page about the Python functions is executed as a reader would, from an empty folder."""

from __future__ import annotations

import io
import re
from contextlib import redirect_stdout

import pytest

PAGE = "docs/start/python-api.md"
CELL = re.compile(r"```python\n(?P<code>.*?)```(?:\n\n```text\n(?P<shown>.*?)```)?", re.DOTALL)
NUMBER = re.compile(r"\d+(?:\.\d+)?")


@pytest.mark.slow
def test_the_page_prints_what_it_shows(root, tmp_path, monkeypatch):
    cells = list(CELL.finditer((root / PAGE).read_text("utf-8")))
    monkeypatch.chdir(tmp_path)
    names: dict = {}
    for cell in cells:
        said = io.StringIO()
        with redirect_stdout(said):
            exec(compile(cell["code"], PAGE, "exec"), names)
        if cell["shown"] is None:
            continue
        assert NUMBER.sub("#", said.getvalue()) == NUMBER.sub("#", cell["shown"])
        shown = [float(number) for number in NUMBER.findall(cell["shown"])]
        # Another processor rounds otherwise, and a digit may flip.
        assert [float(n) for n in NUMBER.findall(said.getvalue())] == pytest.approx(shown, rel=0.05)
    assert sum(cell["shown"] is not None for cell in cells) >= 5
    assert (tmp_path / "dam/result.json").is_file()
