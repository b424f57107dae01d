"""The record of how a result was made."""

from __future__ import annotations

import json

import pipeline
from pipeline import manifest as manifest_module
from pipeline.config import Config, config_hash
from pipeline.manifest import code_version, manifest


def test_manifest_is_complete_and_plain():
    record = manifest(Config(), {"geometry": 3})
    assert json.loads(json.dumps(record)) == record
    assert record["config_hash"] == config_hash(Config())
    assert record["seeds"] == {"geometry": 3}
    assert record["code_version"].startswith(pipeline.__version__)
    assert {"python", "numpy", "taichi"} <= set(record["packages"])
    assert record["machine"]["cores"] >= 1 and record["machine"]["processor"]
    assert record["made"].endswith("+00:00")


def test_without_git_the_version_is_enough(monkeypatch):
    monkeypatch.setenv("PATH", "")
    assert code_version() == pipeline.__version__


def test_outside_a_checkout_no_other_repository_is_asked(monkeypatch, tmp_path):
    monkeypatch.setattr(manifest_module, "__file__", str(tmp_path / "pipeline" / "manifest.py"))
    assert code_version() == pipeline.__version__
