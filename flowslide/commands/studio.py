"""`flowslide studio`: a local page in the browser."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from flowslide.commands import options

if TYPE_CHECKING:
    import socket

    from flowslide.studio.workspace import Workspace

DESCRIPTION = (
    "Open a page in the browser: move the strengths, the water and the effects of a case, watch it "
    "flow, compare it with what was measured, and start back-analyses and diagnoses. It is served "
    "on this machine alone."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    parser.add_argument(
        "case",
        nargs="?",
        metavar="CASE",
        help="case folder, its name in case_histories, or a folder of cases; default: this folder",
    )
    parser.add_argument(
        "--port",
        type=int,
        metavar="N",
        help="default: one that is kept for the folder, or where it is taken any that is free",
    )
    parser.add_argument("--no-browser", action="store_true", help="print the address alone")
    options.add_threads(parser)


def run(arguments: argparse.Namespace) -> None:
    """Serve until it is stopped."""
    import webbrowser
    from contextlib import suppress
    from threading import Thread

    import uvicorn

    from flowslide.studio.app import MOST_BYTES, studio
    from flowslide.studio.live_process import LiveProcess
    from flowslide.studio.security import new_token, write_opening
    from flowslide.studio.temporary import (
        clear_left_behind,
        ended_in_order,
        temporary_folder,
    )
    from pipeline.cli import InputError

    workspace, first = workspace_of(arguments.case)
    listener = listen(arguments.port, workspace.folder)
    port, token = listener.getsockname()[1], new_token()
    live, ahead = LiveProcess(arguments.threads), LiveProcess(1, "forecast")
    address = f"http://127.0.0.1:{port}/?token={token}"

    def show(folder: Path) -> None:
        print(f"the studio of {workspace.folder} (stop it with Ctrl-C):\n{address}", flush=True)
        if not arguments.no_browser:  # some end only when they are closed
            page = write_opening(folder, address).as_uri()
            Thread(target=webbrowser.open, args=(page,), daemon=True).start()

    if first:
        with suppress(InputError):  # the page shows what is wrong
            live.warm(workspace.case(first).resolved())
            ahead.warm(workspace.case(first).resolved())
    try:
        with suppress(KeyboardInterrupt), ended_in_order(), temporary_folder() as folder:
            clear_left_behind()
            app = studio(
                workspace,
                live,
                token=token,
                first=first,
                forecaster=ahead,
                when_ready=lambda: show(folder),
            )
            # Nothing leaves the machine: to compress a deposit takes longer than to pass it on.
            config = uvicorn.Config(
                app,
                log_level="warning",
                access_log=False,
                ws="websockets-sansio",
                ws_max_size=MOST_BYTES,
                ws_per_message_deflate=False,
            )
            uvicorn.Server(config).run(sockets=[listener])  # until Ctrl-C
    finally:
        live.close()
        ahead.close()


def listen(port: int | None, folder: Path) -> socket.socket:
    """A socket of this machine alone that listens: who opens the address at once waits.

    Without a port it has the one of the folder, every time the same: a page that was open when the
    server ended finds the next one there, and saves what it holds.

    Raises:
        InputError: the port is none, or taken.
    """
    from pipeline.cli import InputError

    if port is not None:
        try:
            return _listening(port)
        except (OSError, OverflowError) as error:
            raise InputError(f"--port {port}: {error}") from None
    try:
        return _listening(usual_port(folder))
    except OSError:
        return _listening(0)


def usual_port(folder: Path) -> int:
    """The port of a folder, below those that systems give to who asks for any."""
    from pipeline.files import content_hash

    return 20_000 + int(content_hash(str(folder)), 16) % 12_000


def _listening(port: int) -> socket.socket:
    import socket

    # Named, or asyncio leaves Nagle on: 40 ms from the head of an answer to its body.
    listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    try:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind(("127.0.0.1", port))
        listener.listen()
    except (OSError, OverflowError):
        listener.close()
        raise
    return listener


def workspace_of(text: str | None) -> tuple[Workspace, str]:
    """The workspace of what was typed, and the case that is shown first; empty: any.

    A folder with `scene3d.yaml` alone is a case in three dimensions, and so is that file where it
    is named; the page knows them by `BODY` before their names.

    Raises:
        InputError: there is no such case or folder.
    """
    from flowslide.studio.bodies import BODY
    from flowslide.studio.workspace import Workspace
    from geometry.case import SCENE_FILE
    from geometry.scenes3d.scene3d import FILE_NAME as BODY_FILE
    from geometry.scenes3d.scene3d import is_body
    from pipeline.cli import InputError
    from pipeline.places import CASES, resolve, shipped

    if text is None:
        return Workspace(Path.cwd()), ""
    named = Path(text).name == BODY_FILE
    place = resolve(Path(text).parent if named else text, CASES)
    if not place.is_dir():
        raise InputError(f"{text}: no such case, and no such folder")
    body = BODY if is_body(place / BODY_FILE if named else place) else ""
    if not (body or (place / SCENE_FILE).is_file()):
        return Workspace(place), ""
    if place.resolve().parent == shipped(CASES).resolve():
        return Workspace(Path.cwd()), body + place.name
    return Workspace(place.resolve().parent), body + place.resolve().name
