"""`docs/method/diagnosis.md` names every key, command, option, picture and file."""

from __future__ import annotations

import re

import pytest

from diagnosis.hypotheses.hypothesis_file import ModelEffect, ModelFile
from diagnosis.question import DiagnosisQuestion
from diagnosis.verdict.verdict import Verdict
from flowslide.command_line import DIAGNOSE
from pipeline.config import DiagnosisSettings


@pytest.fixture(scope="module")
def text(root) -> str:
    return (root / "docs/method/diagnosis.md").read_text("utf-8")


@pytest.mark.parametrize(
    "model", [DiagnosisQuestion, DiagnosisSettings, ModelFile, ModelEffect, Verdict]
)
def test_every_key_is_explained(text, model):
    named = set(re.findall(r"[a-z_0-9]+", " ".join(re.findall(r"`([^`\n]+)`", text))))
    assert not set(model.model_fields) - named


def test_every_command_is_there(text):
    for name in DIAGNOSE.commands:
        assert f"python -m diagnosis {name} " in text, name


def test_every_file_of_the_package_has_its_line(text, root):
    listed = set(re.findall(r"[a-z_0-9]+", text[text.index("## Files of the package") :]))
    for path in (root / "diagnosis").glob("*.py"):
        if not path.stem.startswith("__") and not path.stem.endswith("_command"):
            assert path.stem in listed, path.stem


def test_every_picture_is_explained(text, root):
    page = (root / "report/diagnosis/page.py").read_text("utf-8")
    made = set(re.findall(r'"([a-z_]+\.svg)"', page))
    assert len(made) > 8
    assert {name for name in made if f"`{name}`" not in text} == set()


def test_links_lead_somewhere(text, root):
    for name in re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", text):
        assert (root / "docs/method" / name).is_file(), name
