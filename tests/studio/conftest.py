"""A small case in a workspace of its own, and the studio that serves it."""

from __future__ import annotations

import shutil
import textwrap
from itertools import count
from typing import TYPE_CHECKING

import pytest

from benchmarks.studio import CHROMIUM, QUIET, serving
from flowslide.studio.workspace import Workspace
from tests.studio.browsing import answered, close_pages, watched

if TYPE_CHECKING:
    from playwright.sync_api import Browser

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
       confidence: published, source: test NUMBER}
"""
INVERSION = """
parameters:
  - {name: strength, label: S_r, zones: [loose], property: residual_strength_kpa, start: 8.0,
     low: 2.0, high: 40.0}
loss: misfit
"""
WRITTEN = count()
RUNNING: list[Browser] = []
"""Browsers that may have pages of the case open."""


@pytest.fixture(scope="module")
def cases(tmp_path_factory):
    """The folder of the tests of a file, which is emptied between them."""
    return tmp_path_factory.mktemp("studio") / "cases"


@pytest.fixture
def workspace(cases):
    """The small case, as it was drawn, and nothing else."""
    write_small(cases)
    yield Workspace(cases)
    for browser in RUNNING:  # whichever of the two a test names first
        close_pages(browser)
    empty(cases)


@pytest.fixture
def lone_workspace(tmp_path):
    """The same in a folder that no studio serves yet: the first one gets the folder's port."""
    write_small(tmp_path / "cases")
    return Workspace(tmp_path / "cases")


@pytest.fixture(scope="module")
def studio(cases):
    """Address of a studio that runs in a process of its own.

    One serves all tests of a file: to start a server and to compile its kernels takes nine seconds,
    and longer beside another worker.
    """
    write_small(cases)
    with serving(cases / "small", "--threads", "1") as found:
        yield found


@pytest.fixture
def address(studio, workspace):
    """Of a studio with the small case."""
    return studio


@pytest.fixture(scope="module")
def chromium():
    """A browser that runs."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        found = playwright.chromium.launch(executable_path=CHROMIUM, args=QUIET)
        RUNNING.append(found)
        yield found
        RUNNING.remove(found)
        found.close()


@pytest.fixture
def browser(chromium):
    """A browser without a window; the pages of a test are closed once all is saved."""
    yield chromium
    close_pages(chromium)


@pytest.fixture
def page(address, browser):
    """The page once it shows its first deposit; at the end its scripts have had no error."""
    found = watched(browser, width=1380, height=860)
    found.goto(address)
    answered(found, 1)
    yield found
    assert not found.errors


def write_small(cases):
    """Write the small case; what else is there goes.

    Each has a source of its own, and with it a revision: what a page that has been closed still
    wanted to save is refused.
    """
    empty(cases)
    number = str(next(WRITTEN))
    folder = cases / "small"
    folder.mkdir(parents=True)
    for name, text in (("scene", SCENE), ("measurements", MEASUREMENTS), ("inversion", INVERSION)):
        path = folder / f"{name}.yaml"
        path.write_text(textwrap.dedent(text).lstrip().replace("NUMBER", number))


def empty(cases):
    """Remove what is in the folder; the server has it open, so it stays itself."""
    for path in cases.glob("*"):
        shutil.rmtree(path, ignore_errors=True) if path.is_dir() else path.unlink()
