"""Units that a person reads have signs for their powers."""

from __future__ import annotations

import ast
import re
from pathlib import Path

from pipeline.units import with_signs

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("diagnosis", "flowslide", "geometry", "inversion", "mpm_taichi", "pipeline", "report")
PLAIN = re.compile(r"(?<![\w.])(?:[A-Za-z]+/)?(?:k|c)?(?:m|ft)[23](?![\w(])")


def test_powers_of_units_get_their_signs():
    written = [with_signs(unit) for unit in ("kg/m3", "m3/s per m", "m/s2", "kPa", "", "m")]
    assert with_signs("all of it [kg/m3], of zone m3_2") == "all of it [kg/m³], of zone m3_2"
    assert written == ["kg/m³", "m³/s per m", "m/s²", "kPa", "", "m"]


def _sentences(path: Path) -> list[tuple[int, str]]:
    """Texts of a file with some blanks: less is a unit of a file, and docstrings nobody is shown.

    Descriptions of keys are those of files; the page has them by `with_signs`.
    """
    tree = ast.parse(path.read_text())
    documents = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    described = {
        id(part)
        for node in ast.walk(tree)
        if isinstance(node, ast.keyword) and node.arg == "description"
        for part in ast.walk(node.value)
    }
    return [
        (node.lineno, node.value)
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant) and isinstance(node.value, str)
        and node.value.strip().count(" ") > 2 and id(node) not in documents | described
    ]  # fmt: skip


def test_no_sentence_has_a_unit_without_its_sign():
    found = [
        f"{path.relative_to(ROOT)}:{line}: {text}"
        for package in PACKAGES
        for path in sorted((ROOT / package).rglob("*.py"))
        for line, text in _sentences(path)
        if PLAIN.search(text)
    ]
    assert not found, "\n".join(found)
