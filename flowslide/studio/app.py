"""The studio's server: routes, and the WebSocket of the sliders.

All of it is local; `security.Guard` stands in front. JSON in, JSON out; an `InputError` becomes 400
with its one line.
"""

from __future__ import annotations

import asyncio
import json
import re
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import Any

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.types import ASGIApp
from starlette.websockets import WebSocket, WebSocketDisconnect

from flowslide.studio.case_documents import proposed_question
from flowslide.studio.forms import material_fields, measurement_forms
from flowslide.studio.jobs import KINDS, Jobs
from flowslide.studio.live import PATIENCE_S, Asked, Question, Solver, question
from flowslide.studio.security import Guard
from flowslide.studio.temporary import temporary_folder
from flowslide.studio.units import FIELD_UNITS
from flowslide.studio.workspace import NotKept, Workspace
from geometry.scenes.drawings import FORMATS, read_section, reading, section_document
from geometry.scenes.scene import checked_document
from pipeline import __version__
from pipeline.cli import InputError, WorkFailed
from pipeline.units import with_signs

PAGE = Path(__file__).resolve().parent / "page"
TYPES = {".css": "text/css", ".js": "text/javascript"}
PRELOADED = {".css": "rel=preload; as=style", ".js": "rel=modulepreload"}
#: Files of the page by their names in its addresses; styles first, which the first paint needs.
FILES = {
    path.relative_to(PAGE).as_posix(): path
    for suffix in TYPES
    for path in sorted(PAGE.rglob(f"*{suffix}"))
}
#: Most bytes of a request, and of an uploaded drawing.
MOST_BYTES = 20_000_000
TOO_DEEP = "lists and mappings are nested too deep"
#: A page that a job has made has its styles and pictures within, and no script of ours to reach.
REPORT_POLICY = (
    "default-src 'none'; style-src 'unsafe-inline'; img-src data:; media-src data:; sandbox"
)

Handler = Callable[[Request], Awaitable[Response]]


def studio(
    workspace: Workspace,
    live: Solver,
    *,
    token: str,
    first: str = "",
    forecaster: Solver | None = None,
    when_ready: Callable[[], None] = lambda: None,
) -> ASGIApp:
    """The application.

    Args:
        workspace: that it shows.
        first: case that is shown first; empty: any.
        live: that answers the sliders.
        token: that the browser must know.
        forecaster: that says at once about what the answer will be; None: nothing does.
        when_ready: called as soon as a page would be answered without delay.
    """

    @asynccontextmanager
    async def ready(app: Starlette) -> AsyncIterator[None]:
        await run_in_threadpool(_effects)  # what the first page imports and starts
        when_ready()
        yield

    own = _Studio(workspace, Jobs(workspace, live.threads), live, first, forecaster)
    routes = [
        Route("/", _answering(own.page)),
        Route("/api/workspace", _answering(own.overview)),
        Route("/api/cases", _answering(own.create), methods=["POST"]),
        Route("/api/cases/{name}", _answering(own.read)),
        Route("/api/cases/{name}", _answering(own.save), methods=["PUT"]),
        Route("/api/cases/{name}", _answering(own.remove), methods=["DELETE"]),
        Route("/api/cases/{name}/name", _answering(own.rename), methods=["PUT"]),
        Route("/api/cases/{name}/view", _answering(own.view)),
        Route("/api/cases/{name}/view", _answering(own.save_view), methods=["PUT"]),
        Route("/api/cases/{name}/files/{file}", _answering(own.own_file)),
        Route("/api/cases/{name}/files/{file}", _answering(own.save_file), methods=["PUT"]),
        Route("/api/cases/{name}/revision", _answering(own.revision)),
        Route("/api/bodies/{name}", _answering(own.read_body)),
        Route("/api/bodies/{name}/revision", _answering(own.body_revision)),
        Route("/api/bodies/{name}/ground", _answering(own.ground)),
        Route("/api/question", _answering(own.propose), methods=["POST"]),
        Route("/api/check", _answering(own.check), methods=["POST"]),
        Route("/api/import", _answering(own.import_drawing), methods=["POST"]),
        Route("/api/jobs", _answering(own.jobs)),
        Route("/api/jobs", _answering(own.start_job), methods=["POST"]),
        Route("/api/jobs/{job}", _answering(own.job)),
        Route("/api/jobs/{job}/cancel", _answering(own.cancel_job), methods=["POST"]),
        Route("/api/jobs/{job}/again", _answering(own.again_job), methods=["POST"]),
        Route("/api/jobs/{job}/files/{file}", _answering(own.job_file)),
        Route("/api/jobs/{job}/pdf", _answering(own.job_pdf)),
        WebSocketRoute("/api/live", own.sliders),
        Route("/{name:path}", _answering(own.file)),
    ]
    return Guard(Starlette(routes=routes, lifespan=ready), token=token)


def _answering(handler: Handler) -> Handler:
    """A handler whose InputError is an answer of one line; so are a full disk and the like."""

    async def answer(request: Request) -> Response:
        try:
            return await handler(request)
        except InputError as error:
            return JSONResponse({"message": str(error)}, status_code=400)
        except RecursionError:
            return JSONResponse({"message": TOO_DEEP}, status_code=400)
        except OSError as error:
            return JSONResponse({"message": error.strerror or str(error)}, status_code=500)

    return answer


class _Studio:
    """The handlers of the routes."""

    def __init__(
        self,
        workspace: Workspace,
        jobs: Jobs,
        live: Solver,
        first: str,
        forecaster: Solver | None,
    ) -> None:
        self.workspace, self.work, self.live, self.first = workspace, jobs, live, first
        self.forecaster = forecaster

    async def page(self, request: Request) -> Response:
        """The page; its scripts are asked for at once, not as one is found to import the next."""
        links = ", ".join(f"</{name}>; {PRELOADED[path.suffix]}" for name, path in FILES.items())
        return Response(
            (PAGE / "index.html").read_bytes(), headers={"link": links}, media_type="text/html"
        )

    async def file(self, request: Request) -> Response:
        """A script or a style."""
        path = FILES.get(request.path_params["name"])
        if path is None:
            return Response(status_code=404)
        return Response(path.read_bytes(), media_type=TYPES[path.suffix])

    # --- cases ---

    async def overview(self, request: Request) -> Response:
        """Cases, effects, kinds of jobs."""
        return JSONResponse(
            {
                "folder": str(self.workspace.folder),
                "cases": self.workspace.cases(),
                "bodies": self.work.bodies.listed(),
                "left_out": sorted({*self.workspace.left_out(), *self.work.bodies.left_out()}),
                "first": self.first,
                "version": __version__,
                "drawings": FORMATS,
                "job_kinds": KINDS,
                "effects": await run_in_threadpool(_effects),
                "materials": material_fields(),
                "measurements": measurement_forms(),
                "units": FIELD_UNITS,
            }
        )

    async def create(self, request: Request) -> Response:
        """A new case."""
        asked = await _body(request)
        name, copied = str(asked.get("name", "")), asked.get("copy_of")
        copied = None if copied is None else str(copied)
        await run_in_threadpool(self.workspace.create, name, copied, asked.get("scene"))
        return JSONResponse(await run_in_threadpool(self.workspace.read, name), status_code=201)

    async def read(self, request: Request) -> Response:
        """A case."""
        return JSONResponse(
            await run_in_threadpool(self.workspace.read, request.path_params["name"])
        )

    async def save(self, request: Request) -> Response:
        """An edit of a case; 409 where its files were changed elsewhere.

        With an `answer` the edit keeps that of this job, and is nothing else.
        """
        name, asked = request.path_params["name"], await _body(request)
        revision = str(asked.get("revision", ""))
        try:
            saved = await run_in_threadpool(self.workspace.save, name, revision, asked)
        except NotKept as error:
            told = {"message": error.words, "revision": error.revision}
            return JSONResponse(told, status_code=500)
        found = await run_in_threadpool(self.workspace.read, name)
        if saved:
            if job := str(asked.get("answer") or ""):
                now = found["revision"]
                await run_in_threadpool(self.work.keep, job, name, revision, now)
            return JSONResponse(found)
        words = "the files of this case were changed elsewhere"
        return JSONResponse({"message": words, "case": found}, status_code=409)

    async def rename(self, request: Request) -> Response:
        """Give a case another name."""
        name, other = request.path_params["name"], str((await _body(request)).get("name", ""))

        def change() -> None:
            self.work.refuse_while_busy(name)
            self.workspace.rename(name, other)

        await run_in_threadpool(change)
        return JSONResponse({})

    async def remove(self, request: Request) -> Response:
        """Take a case out; its files are kept."""
        name = request.path_params["name"]

        def change() -> str:
            self.work.refuse_while_busy(name)
            return str(self.workspace.remove(name))

        return JSONResponse({"kept": await run_in_threadpool(change)})

    async def revision(self, request: Request) -> Response:
        """What changes with every edit."""
        name = request.path_params["name"]
        return JSONResponse({"revision": await run_in_threadpool(self.workspace.revision, name)})

    # --- cases in three dimensions ---

    async def read_body(self, request: Request) -> Response:
        """A case in three dimensions."""
        return JSONResponse(
            await run_in_threadpool(self.work.bodies.read, request.path_params["name"])
        )

    async def body_revision(self, request: Request) -> Response:
        """What changes with every edit of its files."""
        name = request.path_params["name"]
        return JSONResponse({"revision": await run_in_threadpool(self.work.bodies.revision, name)})

    async def ground(self, request: Request) -> Response:
        """It before the slide, in plan: a binary message of `body_maps`."""
        spacing = _spacing(request.query_params.get("spacing_m"))
        name = request.path_params["name"]
        found = await run_in_threadpool(self.work.bodies.ground, name, spacing)
        return Response(found, media_type="application/octet-stream")

    # --- documents that are not saved ---

    async def propose(self, request: Request) -> Response:
        """The question that `flowslide new` would ask of the documents."""
        question = await run_in_threadpool(proposed_question, await _body(request))
        return JSONResponse({"inversion": question})

    async def check(self, request: Request) -> Response:
        """Faults of documents that are not saved."""
        asked = await _body(request)
        faults = await run_in_threadpool(
            self.workspace.faults, str(asked.get("name", "new")), asked
        )
        return JSONResponse({"faults": [vars(one) for one in faults]})

    async def view(self, request: Request) -> Response:
        """What the page remembers of a case."""
        return JSONResponse(self.workspace.view(request.path_params["name"]))

    async def save_view(self, request: Request) -> Response:
        """Keep it."""
        self.workspace.save_view(request.path_params["name"], await _body(request))
        return JSONResponse({})

    async def own_file(self, request: Request) -> Response:
        """A picture of the page's own."""
        name, file = request.path_params["name"], request.path_params["file"]
        return FileResponse(self.workspace.picture(name, file))

    async def save_file(self, request: Request) -> Response:
        """Keep one."""
        content = await _bytes(request)
        name, file = request.path_params["name"], request.path_params["file"]
        await run_in_threadpool(self.workspace.save_file, name, file, content)
        return JSONResponse({})

    async def import_drawing(self, request: Request) -> Response:
        """The body is the drawing; its name and unit are in the query."""
        name = _file_name(request.query_params.get("name", ""))
        content = await _bytes(request)
        unit = request.query_params.get("unit") or None
        return JSONResponse(await run_in_threadpool(_drawn, name, content, unit))

    # --- jobs ---

    async def jobs(self, request: Request) -> Response:
        """All jobs."""
        return JSONResponse(await run_in_threadpool(self.work.all))

    async def start_job(self, request: Request) -> Response:
        """Start one."""
        asked = await _body(request)
        kind, case = str(asked.get("kind", "")), str(asked.get("case", ""))
        options, body = asked.get("options") or {}, asked.get("body") is True
        found = await run_in_threadpool(self.work.start, kind, case, options, body=body)
        return JSONResponse(found, status_code=201)

    async def job(self, request: Request) -> Response:
        """One."""
        return JSONResponse(await run_in_threadpool(self.work.state, request.path_params["job"]))

    async def cancel_job(self, request: Request) -> Response:
        """Stop one."""
        return JSONResponse(await run_in_threadpool(self.work.cancel, request.path_params["job"]))

    async def again_job(self, request: Request) -> Response:
        """Go on with one that was stopped."""
        return JSONResponse(await run_in_threadpool(self.work.again, request.path_params["job"]))

    async def job_file(self, request: Request) -> Response:
        """A file that one has left."""
        path = await run_in_threadpool(
            self.work.file, request.path_params["job"], request.path_params["file"]
        )
        headers = {"content-security-policy": REPORT_POLICY} if path.suffix == ".html" else {}
        return FileResponse(path, headers=headers)

    async def job_pdf(self, request: Request) -> Response:
        """The page of one as PDF."""
        number = request.path_params["job"]
        try:
            path = await run_in_threadpool(self.work.pdf, number)
        except WorkFailed as error:
            raise InputError(str(error)) from None
        job = await run_in_threadpool(self.work.state, number)
        return FileResponse(path, filename=f"{job['case']}-{job['kind']}.pdf")

    # --- sliders ---

    async def sliders(self, socket: WebSocket) -> None:
        """Questions of the sliders in, deposits out; the newest question wins."""
        await socket.accept()
        sending: set[asyncio.Task[None]] = set()
        line = _Line()
        try:
            while True:
                text = await socket.receive_text()
                if len(text) > MOST_BYTES:
                    await socket.close(1009)
                    return
                task = asyncio.create_task(self._answer(socket, text, line))
                sending.add(task)
                task.add_done_callback(sending.discard)
        except WebSocketDisconnect:
            pass
        finally:
            self.live.stop(socket)
            if self.forecaster is not None:
                self.forecaster.stop(socket)
            for task in sending:
                task.cancel()

    def _whole(self, asked: Asked) -> Question:
        return question(asked, self.workspace.case(asked.case, asked.documents))

    async def _answer(self, socket: WebSocket, text: str, line: _Line) -> None:
        """Answer a question, if it is still the last one of its page when its turn comes."""
        number = 0
        try:
            message = _object(text)
            number = message.get("id", 0)
            asked = checked_document(Asked, message, "question", "flowslide/studio/live.py")
            line.newest = max(line.newest, asked.id)
            whole = await run_in_threadpool(self._whole, asked)
            if asked.id < line.newest:  # threads end in any order
                return
            ahead = None
            if self.forecaster is not None and not asked.film:
                first = self.forecaster.ask(whole, socket)
                ahead = asyncio.create_task(_send_ahead(socket, asyncio.wrap_future(first)))
            if not await line.turn(asked.id):
                return
            line.running = asyncio.wrap_future(self.live.ask(whole, socket))
            found = await line.running
            if ahead is not None:
                ahead.cancel()  # the deposit itself is there
            if found is not None:
                await socket.send_bytes(found)
        except (InputError, WorkFailed) as error:
            await socket.send_json({"type": "failed", "id": number, "message": str(error)})
        except WebSocketDisconnect:
            pass
        except Exception as error:
            words = f"ended by an error of the program: {error!r}"
            await socket.send_json({"type": "failed", "id": number, "message": words})
            raise


class _Line:
    """The questions of a page: one is computed, the newest waits."""

    def __init__(self) -> None:
        self.newest = 0
        self.running: asyncio.Future[bytes | None] | None = None

    async def turn(self, number: int) -> bool:
        """Wait for what is computed, as far as it does not take long; false: a newer one came.

        The solver would stop it itself; to send it every question of a drag takes its time.
        """
        if self.running is not None:
            await asyncio.wait({self.running}, timeout=PATIENCE_S)
        return number >= self.newest


async def _send_ahead(socket: WebSocket, forecast: asyncio.Future[bytes | None]) -> None:
    """Pass a forecast on; one that fails is none, since the deposit follows anyway."""
    with suppress(WorkFailed, WebSocketDisconnect, RuntimeError):
        found = await forecast
        if found is not None:
            await socket.send_bytes(found)


async def _body(request: Request) -> dict[str, Any]:
    return _object((await _bytes(request)).decode("utf-8", "replace"))


async def _bytes(request: Request) -> bytes:
    """The body, refused as soon as it is too long."""
    found = b""
    async for part in request.stream():
        found += part
        if len(found) > MOST_BYTES:
            raise InputError(f"more than {MOST_BYTES / 1e6:.0f} MB")
    return found


def _spacing(text: str | None) -> float | None:
    """A spacing of a query [m]; None: it has none.

    Raises:
        InputError: it is no length.
    """
    if text is None:
        return None
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not 0.0 < value < float("inf"):
        raise InputError(f"spacing_m: {text[:20]!r}: must be a number greater than 0")
    return value


def _file_name(text: str) -> str:
    """A name for a file that somebody has sent: no way to another folder, no special characters."""
    return re.sub(r"[^\w .-]", "_", Path(text).name)[-100:].lstrip(".") or "drawing"


def _object(text: str) -> dict[str, Any]:
    try:
        found = json.loads(text)
    except ValueError as error:
        raise InputError(f"no JSON: {error}") from None
    except RecursionError:
        raise InputError(TOO_DEEP) from None
    if not isinstance(found, dict):
        raise InputError("must be a JSON object")
    return found


def _drawn(name: str, content: bytes, unit: str | None) -> dict[str, Any]:
    with temporary_folder() as folder:
        path = folder / name
        path.write_bytes(content)
        try:
            section = read_section(path)
            scene = section_document(section, source=name, name=path.stem, unit=unit)
            return {"scene": scene, "read": reading(section, unit)}
        except InputError as error:
            raise InputError(str(error).replace(f"{folder}/", "")) from None


def _effects() -> list[dict[str, Any]]:
    """Effects that need no place, for the switches."""
    from mpm_taichi.effects import effects

    return [
        {
            "name": name,
            "unit": with_signs(one.amplitude.unit),
            "low": one.amplitude.low,
            "ladder": one.amplitude.ladder,
            "meaning": with_signs(one.amplitude.meaning),
        }
        for name, one in effects().items()
        if not one.place and not one.internal
    ]
