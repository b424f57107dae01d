"""The examples in the docstrings of the public functions do what they show."""

from __future__ import annotations

import doctest

import pytest

import flowslide.api
import pipeline.config


@pytest.mark.slow
@pytest.mark.long
def test_the_examples_of_the_api_run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    found = doctest.testmod(flowslide.api)
    assert found.attempted >= 18 and found.failed == 0


def test_the_example_of_the_settings_runs():
    found = doctest.testmod(pipeline.config)
    assert found.attempted == 1 and found.failed == 0
