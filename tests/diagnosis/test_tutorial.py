"""The tutorial: its commands are run, and what it shows is what they print."""

from __future__ import annotations

import re
import shlex
from dataclasses import dataclass
from pathlib import Path

import pytest

from diagnosis.verdict.verdict import load_verdict
from flowslide.command_line import main
from pipeline.files import read_json

TUTORIAL = Path("docs/how-to/find-a-hidden-effect.md")
PROGRAM = "flowslide "
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
NEAR, LEAST = 0.15, 0.25
"""Numbers may differ by this share, or by this, on another machine."""


@dataclass(frozen=True)
class Shown:
    """Commands of a block, and the lines the tutorial shows of their output."""

    commands: list[str]
    lines: list[str]


def shown_in(text: str) -> list[Shown]:
    """Blocks of commands with the block of output that follows, if one does."""
    blocks = re.findall(r"```(bash|text)\n(.*?)```", text, flags=re.DOTALL)
    found: list[Shown] = []
    for kind, body in blocks:
        lines = [line for line in body.splitlines() if line.strip()]
        if kind == "bash":
            found.append(Shown(lines, []))
        else:
            found[-1].lines.extend(lines)
    return found


def agree(shown: str, printed: str) -> bool:
    """A printed line holds the shown one: words alike, numbers near, `...` for anything."""
    parts = [_pattern(part) for part in shown.split("...")]
    match = re.search(".*".join(parts), " ".join(printed.split()))
    if match is None:
        return False
    pairs = zip(NUMBER.findall(shown), match.groups(), strict=True)
    return all(abs(float(a) - float(b)) <= max(LEAST, NEAR * abs(float(a))) for a, b in pairs)


def _pattern(text: str) -> str:
    """The words of a text, with any number where it has one."""
    words = " ".join(text.split())
    pieces = NUMBER.split(words)
    return f"({NUMBER.pattern})".join(map(re.escape, pieces))


@pytest.fixture(scope="module")
def tutorial(root) -> list[Shown]:
    return shown_in((root / TUTORIAL).read_text("utf-8"))


@pytest.mark.parametrize(
    ("shown", "printed", "same"),
    [
        ("S_r   8.87 +- 0.18  kPa", "S_r of   x", False),
        ("S_r   8.87 +- 0.18  kPa", "S_r 8.9 +- 0.2 kPa", True),
        ("S_r   8.87 +- 0.18  kPa", "S_r 11.9 +- 0.2 kPa", False),
        ("fails (p ...); along toe", "It fails (p 6.2e-08); along toe, 5 s", True),
        ("fails (p ...); along toe", "It fails (p 6.2e-08); along crest", False),
    ],
)
def test_lines_agree_in_words_and_nearly_in_numbers(shown, printed, same):
    assert agree(shown, printed) is same


def test_files_and_pictures_of_the_tutorial_are_there(root):
    text = (root / TUTORIAL).read_text("utf-8")
    linked = [name for name in re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", text)]
    assert linked
    for name in linked:
        assert (root / TUTORIAL.parent / name).is_file(), name


@pytest.mark.slow
@pytest.mark.long
def test_the_commands_show_what_the_tutorial_says(tutorial, root, tmp_path, monkeypatch, capsys):
    """All commands in the order of the tutorial, one after another on the same results."""
    monkeypatch.chdir(root)
    ran = 0
    for block in tutorial:
        printed = ""
        for command in block.commands:
            if command.startswith(PROGRAM):
                words = shlex.split(command.removeprefix(PROGRAM))
                folder = f"results_folder={tmp_path}"
                assert not main([*words, "--set", folder, "--quiet"]), command
                ran += 1
                printed += capsys.readouterr().out
            elif command.startswith("cat "):
                printed += Path(command.removeprefix("cat ")).read_text("utf-8")
        lines = printed.splitlines()
        for line in block.lines:
            assert any(agree(line, one) for one in lines), f"{line!r} is not in:\n{printed}"
    assert ran == 5
    folder = tmp_path / "hidden_effect" / "diagnosis"
    for name in ("compare", "explain", "report", "track"):
        assert (folder / f"{name}.html").stat().st_size > 20_000, name
    truth = read_json(root / "docs/examples/hidden_effect_truth.json")
    verdict = load_verdict(folder)
    (named,) = verdict.answer.effects
    assert {named.name} == set(truth["effects"])
    low, high = named.interval_95
    assert low < truth["effects"][named.name] < high
    for name, value in truth["parameters"].items():
        assert abs(verdict.final.values[name] - value) < 2.5 * verdict.final.std[name]
