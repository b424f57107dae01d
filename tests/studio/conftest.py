"""A small case in a workspace of its own, and the studio that serves it."""

from __future__ import annotations

import shutil
import textwrap

import pytest

from benchmarks.studio import CHROMIUM, QUIET, serving
from flowslide.studio.workspace import Workspace

SCENE = """
name: small
domain: {x_min: 0.0, x_max: 120.0, y_max: 24.0, walls: open}
ground: {points: [[0.0, 0.0], [120.0, 0.0]], contact: rough}
zones:
  - {name: loose, material: loose, polygon: [[40.0, 0.0], [70.0, 0.0], [70.0, 6.0], [52.0, 6.0]]}
  - {name: crest, material: firm, polygon: [[52.0, 6.0], [70.0, 6.0], [70.0, 10.0], [60.0, 10.0]]}
  - {name: back, material: firm, polygon: [[70.0, 0.0], [90.0, 0.0], [70.0, 10.0]]}
materials:
  loose: {friction_deg: 0.0, cohesion_kpa: 8.0, density: 1900.0, youngs_modulus_mpa: 20.0,
          poisson_ratio: 0.3, liquefied: true}
  firm: {friction_deg: 34.0, cohesion_kpa: 1.0, density: 1900.0, youngs_modulus_mpa: 20.0,
         poisson_ratio: 0.3}
spacing: 1.0
"""
MEASUREMENTS = """
case: small
upstream: left
initial: {toe_left_x_m: 40.0}
default_set: field
sets:
  field:
    - {name: toe, type: toe_runout, side: left, value_m: 14.0, std_m: 2.0, std_is: assumed,
       confidence: published, source: test}
"""
INVERSION = """
parameters:
  - {name: strength, label: S_r, zones: [loose], property: residual_strength_kpa, start: 8.0,
     low: 2.0, high: 40.0}
loss: misfit
"""


@pytest.fixture
def workspace(tmp_path):
    folder = tmp_path / "cases" / "small"
    folder.mkdir(parents=True)
    for name, text in (("scene", SCENE), ("measurements", MEASUREMENTS), ("inversion", INVERSION)):
        (folder / f"{name}.yaml").write_text(textwrap.dedent(text).lstrip())
    yield Workspace(tmp_path / "cases")
    shutil.rmtree(tmp_path / "cases", ignore_errors=True)


@pytest.fixture
def address(workspace):
    """Of a studio that runs in a process of its own."""
    with serving(workspace.folder / "small", "--threads", "1") as found:
        yield found


@pytest.fixture
def browser():
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=CHROMIUM, args=QUIET)
        yield chromium
        chromium.close()


@pytest.fixture
def page(address, browser):
    """The page once it shows its first deposit; at the end its scripts have had no error."""
    from playwright.sync_api import expect

    from tests.studio.browsing import WAIT_MS, watched

    found = watched(browser, width=1380, height=860)
    found.goto(address)
    expect(found.locator('body[data-answered="1"]')).to_have_count(1, timeout=WAIT_MS)
    yield found
    assert not found.errors
