"""Random walks through the studio and drags of a slider: what nobody would think of.

A short walk is a test. With STUDIO_WALK=200 it is 200 actions from each of five seeds, 100 drags,
and (in test_server.py) 200 pairs of questions.
"""

from __future__ import annotations

import random

import pytest

from tests.studio.browsing import NEEDS_CHROMIUM, WAIT_MS, WALK, answered, watched
from tests.studio.walking import Walk

pytestmark = NEEDS_CHROMIUM
#: Actions after which everything must agree.
LEG = 20


@pytest.mark.parametrize("seed", range(5) if WALK else [1])
def test_page_files_and_undo_agree_after_a_walk(browser, lone_workspace, seed):
    walk = Walk(browser, lone_workspace, seed)
    try:
        for number in range(1, (WALK or 40) + 1):
            walk.step()
            if number % LEG == 0:
                walk.agree()
    except BaseException:
        print("\n".join(walk.log[-60:]))
        raise
    finally:
        walk.close()


def test_every_drag_ends_with_the_answer_to_where_it_ended(address, browser):
    page, chance = watched(browser, width=1380, height=860), random.Random(2)
    page.goto(address)
    answered(page, 1)
    slider = page.locator("#sliders input[type=range]").first
    box = slider.bounding_box()
    asked = {}
    for _ in range(100 if WALK else 5):
        x, y = box["x"] + (0.1 + 0.9 * chance.random()) * box["width"], box["y"] + box["height"] / 2
        page.mouse.move(x, y)
        page.mouse.down()
        for _ in range(chance.randint(0, 12)):
            # Without a strength the slide is refused: its energy does not balance.
            low, high = box["x"] + 0.1 * box["width"], box["x"] + box["width"] - 2
            x = min(max(x + chance.randint(-60, 60), low), high)
            page.mouse.move(x, y + chance.randint(-10, 10))
            page.wait_for_timeout(chance.choice((0, 5, 30, 120)))
        page.mouse.up()
        page.wait_for_function(
            "() => document.querySelector('#status').textContent.includes('answered in')",
            timeout=WAIT_MS,
        )
        value = float(slider.input_value())
        assert float(page.get_by_label("S_r, loose [kPa]").input_value()) == value
        toe = float(page.locator("#readings tbody td").nth(2).inner_text().split()[0])
        assert asked.setdefault(value, toe) == toe
    # That of another place would stand out: the weaker, the farther.
    runout = [asked[value] for value in sorted(asked)]
    assert all(far > near - 0.7 for far, near in zip(runout, runout[1:], strict=False)), asked
    assert not page.errors
