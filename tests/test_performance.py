"""The measurements of speed: one program lists them all."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

from benchmarks import performance
from benchmarks.performance.__main__ import MEASUREMENTS, main
from pipeline.cli import InputError

FOLDER = Path(performance.__file__).parent


def test_every_measurement_is_listed(capsys):
    measuring = {
        path.stem
        for path in FOLDER.glob("[a-z]*.py")
        if any(getattr(node, "name", "") == "main" for node in ast.parse(path.read_text()).body)
    }
    assert measuring == set(MEASUREMENTS)
    assert main([]) == 0
    listed = capsys.readouterr().out
    assert all(name in listed for name in MEASUREMENTS)


def test_a_measurement_that_is_not_there():
    with pytest.raises(InputError, match="^speed: no such measurement; there are point_steps, "):
        main(["speed"])
