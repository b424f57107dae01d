"""`docs/method/diagnosis.md` names every key, command, option and picture."""

from __future__ import annotations

import re

import pytest

from diagnosis.hypotheses.hypothesis_file import Hypothesis, HypothesisEffect
from diagnosis.question import DiagnosisQuestion
from diagnosis.verdict.verdict import Verdict
from flowslide.command_line import DIAGNOSE
from pipeline.config import DiagnosisSettings


@pytest.fixture(scope="module")
def text(root) -> str:
    return (root / "docs/method/diagnosis.md").read_text("utf-8")


@pytest.mark.parametrize(
    "model", [DiagnosisQuestion, DiagnosisSettings, Hypothesis, HypothesisEffect, Verdict]
)
def test_every_key_is_explained(text, model):
    named = set(re.findall(r"[a-z_0-9]+", " ".join(re.findall(r"`([^`\n]+)`", text))))
    assert not set(model.model_fields) - named


def test_every_command_is_there(text):
    for name in DIAGNOSE.commands:
        assert f"flowslide diagnose {name} " in text, name


def test_every_room_has_its_line_in_the_architecture(root):
    text = (root / "docs/architecture.md").read_text("utf-8")
    for path in (root / "diagnosis").iterdir():
        if (path / "__init__.py").is_file():
            assert f"`diagnosis/{path.name}`" in text, path.name


def test_every_picture_is_explained(text, root):
    page = (root / "report/diagnosis.py").read_text("utf-8")
    made = set(re.findall(r'"([a-z_]+\.svg)"', page))
    assert len(made) > 8
    assert {name for name in made if f"`{name}`" not in text} == set()


def test_links_lead_somewhere(text, root):
    for name in re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", text):
        assert (root / "docs/method" / name).is_file(), name
