"""Who may talk to the studio: the browser that was given its address, and nothing else.

The server listens on the loopback address. That keeps other machines away, but neither other users
of this one nor pages of other sites that are open in the same browser. Hence:

- a random token in the address; opening it once sets a cookie, and everything needs the cookie.
  A browser is given the address in a file that nobody else can read, since every user of a machine
  sees the words that a program was started with;
- `Host` must be a name of the loopback address itself, or a name that was made to point here could
  read everything (DNS rebinding). Its port is that of the browser's end of the way here, which
  `ssh -L` may give another number than the server's;
- whatever changes something, and the WebSocket, needs the `Origin` of the page that this address
  shows: another port of this machine is another program's page.
"""

from __future__ import annotations

import re
import secrets
from html import escape
from http.cookies import CookieError, SimpleCookie
from pathlib import Path
from urllib.parse import parse_qs

from starlette.datastructures import Headers
from starlette.responses import HTMLResponse, PlainTextResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

#: Names of the loopback address, with the port that the browser has opened.
HOST = re.compile(r"(?:127\.0\.0\.1|localhost|\[::1\])(?::(\d{1,5}))?")
#: With that port in its name: a browser sends a cookie to all ports, and two studios may be open,
#: on two machines with the same port there.
COOKIE = "flowslide_studio_{port}"
SAFE = ("GET", "HEAD")
#: Scripts, styles and pictures of ours alone; `blob:` is a picture that the page made.
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; "
    "connect-src 'self'; frame-src 'self'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'self'"
)


def new_token() -> str:
    """A token that cannot be guessed."""
    return secrets.token_urlsafe(24)


def write_opening(folder: Path, address: str) -> Path:
    """Write a page that leads to an address, which its owner alone can read.

    Args:
        folder: of the page.
        address: with the token.
    """
    page = folder / "open.html"
    page.touch(mode=0o600, exist_ok=False)
    page.write_text(_leading_to(address), encoding="utf-8")
    return page


def _leading_to(address: str) -> str:
    icon = '<link rel="icon" href="data:,">'  # else the browser asks for one that is not there
    return f'<!doctype html>{icon}<meta http-equiv="refresh" content="0; url={escape(address)}">\n'


class Guard:
    """ASGI middleware that refuses everything that is not from the studio's own page."""

    def __init__(self, app: ASGIApp, *, token: str) -> None:
        self.app, self.token = app, token

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer, refuse, or pass on."""
        if scope["type"] not in ("http", "websocket"):
            await self.app(scope, receive, send)
            return
        refused = self._refusal(scope)
        if refused is None:
            await self.app(scope, receive, _with_policy(send))
        elif scope["type"] == "websocket":
            await send({"type": "websocket.close", "code": 4403})
        else:
            await refused(scope, receive, _with_policy(send))

    def _refusal(self, scope: Scope) -> Response | None:
        """What is answered in place of the page; None: go on."""
        headers = Headers(scope=scope)
        host = HOST.fullmatch(headers.get("host", ""))
        if host is None:
            return _no("this address is not the studio's")
        cookie = COOKIE.format(port=host[1] or 80)
        shown = parse_qs(scope.get("query_string", b"").decode("latin-1")).get("token", [""])[0]
        opening = scope["type"] == "http" and scope["path"] == "/" and shown
        if opening and self._is_token(shown):
            # Not a redirect: the cookie, which is strict, would not go along where the browser came
            # from a file.
            answer = HTMLResponse(_leading_to("/"))
            answer.set_cookie(cookie, self.token, httponly=True, samesite="strict")
            return answer
        if not self._is_token(_cookie(headers, cookie)):
            return _no("open the studio by the address that `flowslide studio` printed")
        changes = scope["type"] == "websocket" or scope["method"] not in SAFE
        if changes and headers.get("origin", "") != f"http://{host[0]}":
            return _no("this request comes from another page")
        return None

    def _is_token(self, text: str) -> bool:
        return secrets.compare_digest(text.encode(), self.token.encode())


def _cookie(headers: Headers, name: str) -> str:
    try:
        found = SimpleCookie(headers.get("cookie", "")).get(name)
    except CookieError:
        return ""
    return "" if found is None else found.value


def _no(words: str) -> Response:
    return PlainTextResponse(f"refused: {words}\n", status_code=403)


def _with_policy(send: Send) -> Send:
    async def answer(message: Message) -> None:
        if message["type"] == "http.response.start":
            names = {name for name, _ in message["headers"]}
            extra = {
                b"content-security-policy": POLICY.encode(),
                b"x-content-type-options": b"nosniff",
                b"referrer-policy": b"no-referrer",
                b"cache-control": b"no-store",
            }
            message["headers"] = [
                *message["headers"],
                *((name, value) for name, value in extra.items() if name not in names),
            ]
        await send(message)

    return answer
