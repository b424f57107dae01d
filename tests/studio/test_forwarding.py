"""The studio on another machine, reached by `ssh -L` through another port than its own."""

from __future__ import annotations

import http.client
import json
from urllib.parse import urlsplit

import pytest
from playwright.sync_api import expect
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from benchmarks.studio import serving
from tests.studio.browsing import WAIT_MS, answered, needs_chromium, watched
from tests.studio.forwarding import forwarded
from tests.studio.messages import unpack

pytestmark = pytest.mark.slow


@pytest.fixture
def far(workspace):
    """Token of a studio, and a port that leads to it."""
    with serving(workspace.folder / "small", "--threads", "1") as address:
        found = urlsplit(address)
        with forwarded(found.port) as port:
            yield found.query.removeprefix("token="), port


class Client:
    """A browser's requests, with the cookies that it was given."""

    def __init__(self, port: int) -> None:
        self.port, self.cookie = port, ""

    def ask(self, path: str, method: str = "GET", body: object = None, **headers: str):
        """Status and text of an answer."""
        line = http.client.HTTPConnection("127.0.0.1", self.port, timeout=60)
        sent = {"cookie": self.cookie} | headers
        line.request(method, path, None if body is None else json.dumps(body), sent)
        answer = line.getresponse()
        text = answer.read().decode()
        self.cookie = (answer.getheader("set-cookie") or self.cookie).partition(";")[0]
        line.close()
        return answer.status, text

    def socket(self, host: str, origin: str):
        """The WebSocket of the sliders."""
        headers = {"cookie": self.cookie}
        return connect(f"ws://{host}/api/live", origin=origin, additional_headers=headers,
                       max_size=None, proxy=None)  # fmt: skip


@pytest.mark.parametrize("name", ["localhost", "127.0.0.1"])
def test_pages_edits_and_sliders_pass_through_another_port(far, name):
    token, port = far
    client, host = Client(port), f"{name}:{port}"
    ours = {"host": host, "origin": f"http://{host}"}
    assert client.ask("/api/workspace", host=host)[0] == 403, "not without the token"
    assert client.ask(f"/?token={token}", host=host)[0] == 200
    assert client.cookie.startswith(f"flowslide_studio_{port}=")
    status, text = client.ask("/api/workspace", host=host)
    assert status == 200 and json.loads(text)["first"] == "small"
    made = {"name": "mine", "copy_of": "small"}
    assert client.ask("/api/cases", "POST", made, **ours)[0] == 201
    with client.socket(host, ours["origin"]) as socket:
        socket.send(json.dumps({"type": "run", "id": 7, "case": "mine", "spacing_m": 2.0}))
        header, _ = unpack(socket.recv(timeout=60))
    assert header["id"] == 7

    # What was refused before still is: names that only lead here, and pages of others.
    names = (
        "evil.example",
        "localhost.evil.example",
        "127.0.0.1.nip.io",
        "127.0.0.2",
        "x@localhost",
    )
    for other in (*(f"{one}:{port}" for one in names), f"localhost:{port}x", "localhost:"):
        status, text = client.ask("/api/workspace", host=other)
        assert status == 403 and "not the studio's" in text, other
    same = {"localhost": "127.0.0.1", "127.0.0.1": "localhost"}[name]
    others = ("localhost:3000", "evil.example", f"{same}:{port}")
    for origin in ("null", f"https://{host}", *(f"http://{one}" for one in others)):
        refused = {"host": host, "origin": origin}
        assert client.ask("/api/cases", "POST", {"name": "bad"}, **refused)[0] == 403, origin
        with pytest.raises(InvalidStatus), client.socket(host, origin):
            pass


@needs_chromium
def test_somebody_moves_a_slider_through_another_port(far, browser):
    token, port = far
    page = watched(browser)
    page.goto(f"http://localhost:{port}/?token={token}")
    answered(page, 1)
    page.locator("#sliders input[type=range]").first.focus()
    page.keyboard.press("ArrowLeft")
    answered(page, 2)
    page.get_by_role("tab", name="Section").click()
    page.locator("#section-left .zone input").first.click(click_count=3)
    page.keyboard.type("silt")
    page.keyboard.press("Tab")
    expect(page.locator("#status")).to_have_text("saved", timeout=WAIT_MS)
    assert not page.errors
