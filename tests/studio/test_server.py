"""The server as a browser, another page and a program of somebody else meet it."""

from __future__ import annotations

import errno
import json
import os
import shutil
import time
from concurrent.futures import ThreadPoolExecutor
from itertools import cycle
from pathlib import Path
from threading import Event

import numpy as np
import pytest
from starlette.testclient import TestClient
from starlette.websockets import WebSocketDisconnect

import flowslide
from flowslide.studio import job_process
from flowslide.studio.app import MOST_BYTES, studio
from flowslide.studio.jobs import Job
from flowslide.studio.live import Asked, Live, question
from geometry.case import load_case
from mpm_taichi.comparison import simulate_case
from pipeline.files import read_json, write_json
from pipeline.places import CASES, shipped
from tests.studio.browsing import WALK
from tests.studio.messages import unpack

PORT, TOKEN = 8321, "the-token"
OURS = {"origin": f"http://127.0.0.1:{PORT}"}
PAIRS = WALK or 20
LIVE = f"ws://127.0.0.1:{PORT}/api/live"


@pytest.fixture
def live():
    solver = Live(threads=1)
    yield solver
    solver.close()


@pytest.fixture
def stranger(workspace, live):
    """A client without the cookie."""
    app = studio(workspace, live, token=TOKEN)
    return TestClient(app, base_url=f"http://127.0.0.1:{PORT}", follow_redirects=False)


@pytest.fixture
def browser(stranger):
    """A client that opened the address that was printed."""
    answer = stranger.get("/", params={"token": TOKEN})
    assert answer.status_code == 200 and 'content="0; url=/"' in answer.text
    assert TOKEN not in answer.text
    assert answer.headers["cache-control"] == "no-store"
    assert answer.headers["referrer-policy"] == "no-referrer"
    assert "HttpOnly" in answer.headers["set-cookie"]
    assert "SameSite=strict" in answer.headers["set-cookie"]
    return stranger


def test_the_page_and_its_parts_are_served_with_a_policy(browser):
    page = browser.get("/")
    assert page.status_code == 200 and "flowslide" in page.text
    assert "script-src 'self'" in page.headers["content-security-policy"]
    assert "unsafe" not in page.headers["content-security-policy"]
    for part in ("studio.js", "answer.js", "api.js", "view.js", "studio.css"):
        assert browser.get(f"/{part}").status_code == 200
    assert browser.get("/../security.py").status_code in (403, 404)


@pytest.mark.parametrize("path", ["/", "/?token=other", "/studio.js", "/api/workspace"])
def test_nothing_is_shown_without_the_token(stranger, path):
    answer = stranger.get(path)
    assert answer.status_code == 403 and answer.text.count("\n") == 1
    assert "set-cookie" not in answer.headers
    stranger.cookies.set(f"flowslide_studio_{PORT}", "other")
    assert stranger.get(path).status_code == 403


def test_another_name_for_this_address_is_refused(browser):
    answer = browser.get("/api/workspace", headers={"host": f"evil.example:{PORT}"})
    assert answer.status_code == 403 and "not the studio's" in answer.text


def test_a_document_that_stands_for_a_million_values_is_refused(browser, workspace):
    """Ten lines may be more than the memory holds; the server would answer nobody any more."""
    lines = ["name: small", "a0: &a0 [1]"]
    for n in range(1, 7):
        lines.append(f"a{n}: &a{n} [" + ", ".join(10 * [f"*a{n - 1}"]) + "]")
    (workspace.folder / "small" / "scene.yaml").write_text("\n".join(lines))
    answer = browser.get("/api/cases/small")
    assert answer.status_code == 400
    assert "scene.yaml: line 7: more than 100,000 values" in answer.json()["message"]


@pytest.mark.parametrize("origin", [None, "http://evil.example", "null", "http://127.0.0.1:1"])
def test_another_page_changes_nothing(browser, workspace, origin):
    headers = {} if origin is None else {"origin": origin}
    body = {"name": "mine", "copy_of": "small"}
    assert browser.post("/api/cases", json=body, headers=headers).status_code == 403
    assert not (workspace.folder / "mine").exists()
    with (
        pytest.raises(WebSocketDisconnect),
        browser.websocket_connect(LIVE, headers=headers) as socket,
    ):
        socket.receive_text()


def test_a_case_is_read_copied_edited_and_two_tabs_notice(browser):
    assert browser.get("/api/workspace").json()["cases"][0] == {"name": "small", "shipped": False}
    made = browser.post("/api/cases", json={"name": "mine", "copy_of": "small"}, headers=OURS)
    assert made.status_code == 201
    case = made.json()
    case["scene"]["spacing"] = 3.0
    first = browser.put("/api/cases/mine", json=case, headers=OURS)
    assert first.status_code == 200 and first.json()["derived"]["spacing_m"] == 3.0
    second = browser.put("/api/cases/mine", json=case, headers=OURS)
    assert second.status_code == 409
    assert second.json()["case"]["revision"] == first.json()["revision"]
    assert browser.get("/api/cases/none").json()["message"].startswith("case 'none'")


def test_bad_bodies_get_one_line(browser):
    for body in (b"", b"[1]", b"{", b"\xff\xfe"):
        answer = browser.post("/api/cases", content=body, headers=OURS)
        assert answer.status_code == 400 and "\n" not in answer.json()["message"]
    nothing = browser.post("/api/check", json={}, headers=OURS).json()
    assert [one["document"] for one in nothing["faults"]] == ["scene"]
    answer = browser.post("/api/cases", json={"name": "mine", "copy_of": 5}, headers=OURS)
    assert answer.status_code == 400 and "case '5'" in answer.json()["message"]
    answer = browser.put("/api/cases/small/files/underlay.png", content=b"x" * (MOST_BYTES + 1),
                         headers=OURS)  # fmt: skip
    assert answer.status_code == 400 and "20 MB" in answer.json()["message"]


@pytest.mark.parametrize("file", ["a%00.png", "x" * 300 + ".png", "%2e%2e", "none.png", "A.PNG"])
def test_a_file_that_is_none_gets_one_line(browser, file):
    for ask in (browser.get, lambda path: browser.put(path, content=b"x", headers=OURS)):
        answer = ask(f"/api/cases/small/files/{file}")
        if file != "none.png" or ask is browser.get:
            assert answer.status_code in (400, 404) and "\n" not in answer.text, answer.text


def test_what_is_nested_without_end_gets_one_line(browser):
    for depth, words in ((200_000, "nested too deep"), (900, "")):
        body = b'{"name": "deep", "scene": ' + depth * b"[" + depth * b"]" + b"}"
        answer = browser.post("/api/cases", content=body, headers=OURS)
        assert answer.status_code == 400 and words in answer.json()["message"]


def test_a_case_that_cannot_be_made_leaves_no_folder(browser, workspace):
    answer = browser.post("/api/cases", json={"name": "mine", "scene": "x"}, headers=OURS)
    assert answer.status_code == 400 and "must be a mapping" in answer.json()["message"]
    assert not (workspace.folder / "mine").exists()


def test_a_full_disk_is_said(browser, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "x")

    case = browser.get("/api/cases/small").json()
    monkeypatch.setattr("flowslide.studio.workspace.write_json", full)
    answer = browser.put("/api/cases/small", json=case, headers=OURS)
    assert answer.status_code == 500
    revision = case["revision"]  # nothing of it was written
    assert answer.json() == {"message": "No space left on device", "revision": revision}


def test_a_job_that_cannot_be_started_leaves_nothing(browser, monkeypatch, workspace):
    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "x")

    asked = {"kind": "back_analyse", "case": "small"}
    with monkeypatch.context() as patch:
        patch.setattr("flowslide.studio.jobs.write_json", full)
        answer = browser.post("/api/jobs", json=asked, headers=OURS)
    assert answer.status_code == 500 and answer.json()["message"] == "No space left on device"
    scene = workspace.place("small") / "scene.yaml"  # half written by an editor
    scene.write_text(scene.read_text()[:300])
    answer = browser.post("/api/jobs", json=asked, headers=OURS)
    assert answer.status_code == 400 and "not valid YAML" in answer.json()["message"]
    assert not list(workspace.hidden("small").glob("jobs/*"))


@pytest.mark.parametrize(
    "error",
    [
        OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "run.h5"),
        RuntimeError("Can't write data (errno = 28, error message = 'No space left on device')"),
    ],
)
def test_a_job_on_a_full_disk_says_so(tmp_path, monkeypatch, error):
    """Its progress may have no room either; the work goes on as far as it can."""

    def full(job, folder, told):
        with monkeypatch.context() as patch:
            patch.setattr(job_process, "write_json", write_nothing)
            told.last = 0.0
            told.report(1, 2, "simulating")
        raise error

    def write_nothing(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    job = Job(id="1", kind="compare", case="small", folder="x", options={})
    write_json(tmp_path / "job.json", job.model_dump(mode="json"))
    monkeypatch.setattr(job_process, "_work", full)
    assert job_process.main(tmp_path) == 1
    said = read_json(tmp_path / "state.json")
    assert said["state"] == "failed" and said["done"] == 1
    assert said["message"].endswith(": No space left on device")


def test_an_answer_that_was_kept_is_still_of_its_case(browser, workspace):
    """So is what looks for the same strength; a simulation had the strength of before."""
    case = browser.get("/api/cases/small").json()
    kinds = ["back_analyse", "posterior", "simulate"]
    for number, kind in enumerate(kinds):
        folder = workspace.hidden("small", "jobs", str(number))
        job = Job(id=folder.name, kind=kind, case="small", folder="x", options={},
                  revision=case["revision"])  # fmt: skip
        write_json(folder / "job.json", job.model_dump(mode="json"))
        write_json(folder / "state.json", {"state": "done"})
    case["scene"]["materials"]["loose"]["cohesion_kpa"] = 12.3
    kept = browser.put("/api/cases/small", json={**case, "answer": "0"}, headers=OURS).json()
    of = {one["kind"]: [one["revision"], *one["kept"]] for one in browser.get("/api/jobs").json()}
    assert [kept["revision"] in of[kind] for kind in kinds] == [True, True, False]
    kept["scene"]["spacing"] = 2.0  # an edit of its own
    other = browser.put("/api/cases/small", json=kept, headers=OURS).json()
    of = {one["kind"]: [one["revision"], *one["kept"]] for one in browser.get("/api/jobs").json()}
    assert not any(other["revision"] in revisions for revisions in of.values())


def test_a_folder_that_cannot_be_a_case_is_named(browser, workspace):
    shutil.copytree(workspace.folder / "small", workspace.folder / "mein damm")
    found = browser.get("/api/workspace").json()
    assert found["left_out"] == ["mein damm"]
    assert "mein damm" not in [one["name"] for one in found["cases"]]


def test_a_drawing_is_imported_by_the_same_reader(browser):
    text = "zone,x,y,material,friction_deg,cohesion_kpa,density,youngs_modulus_mpa,poisson_ratio\n"
    rows = ["a,0,0,soil,30,1,1900,20,0.3", "a,10,0", "a,5,5"]
    drawn = text + "\n".join(row + "," * (8 - row.count(",")) for row in rows) + "\n"
    answer = browser.post("/api/import", params={"name": "dam.csv"}, content=drawn, headers=OURS)
    assert answer.status_code == 200, answer.text
    assert answer.json()["scene"]["zones"][0]["name"] == "a"
    for name, content in (
        ("dam.exe", drawn),
        ("dam.csv", "x"),
        ("../dam.csv", "zone,x\n"),
        ("..", drawn),
        ("dam\0.csv", "x"),
        (300 * "x" + ".csv", "x"),
    ):
        bad = browser.post("/api/import", params={"name": name}, content=content, headers=OURS)
        assert bad.status_code == 400 and "/tmp" not in bad.json()["message"]


@pytest.mark.slow
def test_a_slider_gets_the_numbers_of_the_command_line(browser, workspace):
    with browser.websocket_connect(LIVE, headers=OURS) as socket:
        ask = {"type": "run", "id": 1, "case": "small",
               "changes": {"strengths_kpa": {"loose": 7.0}}}  # fmt: skip
        socket.send_text(json.dumps(ask))
        header, arrays = unpack(socket.receive_bytes())
        assert header["id"] == 1 and not header["cached"] and len(header["times"]) == 1
        socket.send_text(json.dumps({**ask, "id": 2, "film": True}))
        again, film = unpack(socket.receive_bytes())
        assert again["cached"] and film["positions"].shape[0] == len(again["times"]) > 5
        socket.send_text(json.dumps({**ask, "id": 3, "changes": {"strengths_kpa": {"lose": 7.0}}}))
        assert json.loads(socket.receive_text()) == {
            "type": "failed", "id": 3, "message": "strengths_kpa: there is no material 'lose'",
        }  # fmt: skip
        for wrong in ({"changes": [1]}, {"spacing_m": -1}, {"spacng_m": 2}, {"set": "none"}):
            socket.send_text(json.dumps({**ask, "id": 4, **wrong}))
            said = json.loads(socket.receive_text())
            assert said["id"] == 4 and "\n" not in said["message"], said
        socket.send_text("nonsense")
        assert json.loads(socket.receive_text())["type"] == "failed"
    done = flowslide.simulate(workspace.folder / "small", strengths_kpa={"loose": 7.0}, threads=1)
    assert np.array_equal(arrays["positions"][0], done.run.positions[-1])
    assert np.array_equal(film["positions"][-1], done.run.positions[-1])
    simulated = [one["simulated"] for one in header["readings"]]
    assert simulated == [one.simulated for one in done.readings]


@pytest.mark.slow
def test_a_kept_run_is_read_by_the_measurements_of_now(browser, workspace):
    ask = {"type": "run", "case": "small"}
    with browser.websocket_connect(LIVE, headers=OURS) as socket:

        def answer():
            socket.send_text(json.dumps(ask))
            return unpack(socket.receive_bytes())[0]

        before = answer()
        case = workspace.read("small")
        case["measurements"]["sets"]["field"][0]["value_m"] = 99.0
        assert workspace.save("small", case["revision"], case)
        after = answer()
        assert after["cached"] and not before["cached"]
        assert after["readings"][0]["measured"] == 99.0
        assert after["readings"][0]["simulated"] == before["readings"][0]["simulated"]
        # A case that is not saved: its documents come along.
        ask |= {"case": "drawn", "scene": case["scene"], "measurements": case["measurements"]}
        assert answer()["readings"] == after["readings"]


def test_of_two_questions_back_to_back_the_newer_is_answered(browser, monkeypatch, workspace):
    """A key press sends such a pair; the cases are read in threads, which end in any order."""
    read, delays = workspace.case, cycle([0.02, 0.0, 0.005, 0.0])

    def slowly(*asked):
        time.sleep(next(delays))
        return read(*asked)

    monkeypatch.setattr(workspace, "case", slowly)
    with (
        browser.websocket_connect(LIVE, headers=OURS) as socket,
        ThreadPoolExecutor(1) as waiter,
    ):
        for number in range(1, 2 * PAIRS + 1, 2):
            for one, value in ((number, 5.0), (number + 1, 6.0)):
                changes = {"strengths_kpa": {"loose": value}}
                ask = {"type": "run", "id": one, "case": "small", "spacing_m": 4.0}
                socket.send_text(json.dumps(ask | {"changes": changes}))
            found = 0
            while found != number + 1:  # of the dropped one there would be no answer at all
                answer = waiter.submit(socket.receive_bytes).result(timeout=30)
                found = unpack(answer)[0]["id"]
                assert found in (number, number + 1)


def test_more_points_than_a_slider_can_move_are_refused_at_once(browser):
    with browser.websocket_connect(LIVE, headers=OURS) as socket:
        ask = {"type": "run", "id": 1, "case": "small", "spacing_m": 0.02}
        socket.send_text(json.dumps(ask))
        said = json.loads(socket.receive_text())
    assert "points at a spacing of 0.02 m: sliders take at most 20,000" in said["message"]


def test_a_run_ends_though_a_newer_question_waits_unless_it_takes_long(workspace, monkeypatch):
    """A dragged slider shows deposits on its way."""
    case = workspace.case("small")

    def asked(value):
        return question(
            Asked(type="run", spacing_m=4.0, changes={"strengths_kpa": {"loose": value}}), case
        )

    for patience, answered in ((60.0, True), (0.0, False)):
        monkeypatch.setattr("flowslide.studio.live.PATIENCE_S", patience)
        live, begun, go_on = Live(threads=1), Event(), Event()

        def simulate(case, *, threads, on_time, begun=begun, go_on=go_on):
            on_time(0.0)
            begun.set()
            assert go_on.wait(60)
            on_time(1.0)
            return simulate_case(case, threads=threads, on_time=on_time)

        monkeypatch.setattr("flowslide.studio.live.simulate_case", simulate)
        first = live.ask(asked(5.0))
        assert begun.wait(60)
        last = live.ask(asked(6.0))
        go_on.set()
        assert (first.result(60) is not None) is answered and last.result(60) is not None
        live.close()


def test_the_newest_question_wins(workspace, live):
    case = workspace.case("small")
    asked = [
        live.ask(question(
            Asked(type="run", id=k, changes={"strengths_kpa": {"loose": 5.0 + k}}), case
        ))
        for k in range(6)
    ]  # fmt: skip
    answers = [one.result(60) for one in asked]
    assert answers[-1] is not None and answers[1:5] == [None] * 4


def test_the_question_of_another_page_goes_on(workspace, live):
    case = workspace.case("small")
    asked = [
        live.ask(
            question(Asked(type="run", changes={"strengths_kpa": {"loose": value}}), case), page
        )
        for page, value in ((1, 5.0), (2, 6.0), (2, 7.0))
    ]
    first, stopped, last = (one.result(60) for one in asked)
    assert first is not None and stopped is None and last is not None


def test_a_pool_takes_its_water_table_along():
    case = load_case(shipped(CASES) / "lower_san_fernando")
    level = case.scene.water_level + 2.0
    scene = question(Asked(type="run", changes={"water_level": level}), case).case.scene
    before, after = (dict(one.phreatic_line) for one in (case.resolved().scene, scene))
    at_pool = [x for x, y in before.items() if abs(y - case.scene.water_level) < 0.05]
    assert at_pool and all(after[x] == level for x in at_pool)
    assert all(after[x] == y for x, y in before.items() if x not in at_pool)


def test_two_studios_in_one_browser_do_not_lock_each_other_out(browser, workspace, live):
    other = studio(workspace, live, token="another")
    second = TestClient(other, base_url=f"http://127.0.0.1:{PORT + 1}", follow_redirects=False)
    second.cookies = browser.cookies  # a browser does not tell ports apart
    assert second.get("/", params={"token": "another"}).status_code == 200
    assert second.get("/api/workspace").status_code == 200
    assert browser.get("/api/workspace").status_code == 200


def _wait(browser, job, states):
    for _ in range(600):
        found = browser.get(f"/api/jobs/{job}").json()
        if found["state"] in states:
            return found
        time.sleep(0.1)
    raise AssertionError(found)


@pytest.mark.slow
def test_a_job_gives_the_result_of_the_command_line(browser, workspace, tmp_path):
    options = {"spacing_m": 2.0, "quick": True}
    asked = {"kind": "back_analyse", "case": "small", "options": options}
    started = browser.post("/api/jobs", json=asked, headers=OURS)
    assert started.status_code == 201
    done = _wait(browser, started.json()["id"], ("done", "failed"))
    assert done["state"] == "done", done
    assert {"result.json", "report.html"} <= set(done["files"])
    files = f"/api/jobs/{done['id']}/files"
    page = browser.get(f"{files}/report.html")
    assert "sandbox" in page.headers["content-security-policy"]
    own = flowslide.back_analyse(workspace.folder / "small", out=tmp_path / "own", quick=True,
                                 spacing_m=2.0)  # fmt: skip
    found = browser.get(f"{files}/result.json").json()
    assert found["answer"]["parameters"] == own.model_dump(mode="json")["answer"]["parameters"]
    for name in ("../job.json", "state.json", "%2e%2e%2fjob.json", "log"):
        assert browser.get(f"{files}/{name}").status_code in (400, 404)


class Process:
    """A job's process that ends when it is told."""

    pid = 2**22 - 1

    def __init__(self, command, **_):
        self.number, self.ended = Path(command[-1]).name, Event()

    def poll(self):
        return 0 if self.ended.is_set() else None

    def wait(self):
        assert self.ended.wait(60)


@pytest.fixture
def processes(monkeypatch):
    """Those that were started, in order."""
    found = []

    def start(command, **options):
        found.append(Process(command, **options))
        return found[-1]

    monkeypatch.setattr("flowslide.studio.jobs.subprocess.Popen", start)
    yield found
    for one in found:
        one.ended.set()


def _state(browser, job, state):
    """Wait until a job has a state."""
    for _ in range(200):
        if browser.get(f"/api/jobs/{job}").json()["state"] == state:
            return
        time.sleep(0.02)
    raise AssertionError(browser.get(f"/api/jobs/{job}").json())


def test_jobs_run_one_after_another(browser, workspace, processes):
    def ask(kind):
        body = {"kind": kind, "case": "small", "options": {}}
        return browser.post("/api/jobs", json=body, headers=OURS).json()

    first, second, third, light = (
        ask(kind) for kind in ("back_analyse", "compare", "simulate", "classical")
    )
    states = [one["state"] for one in (first, second, third, light)]
    assert states == ["running", "waiting", "waiting", "running"], "classical methods take seconds"
    assert [one.number for one in processes] == [first["id"], light["id"]]
    assert browser.post(f"/api/jobs/{second['id']}/again", headers=OURS).status_code == 400
    found = browser.post(f"/api/jobs/{second['id']}/cancel", headers=OURS).json()
    assert found["state"] == "cancelled"
    browser.post(f"/api/jobs/{second['id']}/again", headers=OURS)  # last in the queue now
    processes[0].ended.set()
    _state(browser, third["id"], "running")
    _state(browser, second["id"], "waiting")
    processes[-1].ended.set()
    _state(browser, second["id"], "running")
    assert [one.number for one in processes[2:]] == [third["id"], second["id"]]


def test_a_case_with_a_job_at_work_stays_where_it_is(browser, workspace, processes):
    body = {"kind": "compare", "case": "small", "options": {}}
    job = browser.post("/api/jobs", json=body, headers=OURS).json()["id"]

    def change():
        renamed = browser.put("/api/cases/small/name", json={"name": "other"}, headers=OURS)
        return [renamed, browser.delete("/api/cases/small", headers=OURS)]

    for answer in change():
        assert answer.status_code == 400 and "a job is running" in answer.json()["message"]
    processes[0].ended.set()
    _state(browser, job, "interrupted")
    assert browser.delete("/api/cases/small").status_code == 403, "from another page"
    renamed, removed = change()
    assert renamed.status_code == 200 and removed.status_code == 400
    removed = browser.delete("/api/cases/other", headers=OURS)
    assert Path(removed.json()["kept"], "scene.yaml").is_file()


def test_a_job_that_waits_by_its_folder_alone_starts_nothing(browser, workspace, processes):
    """The folder may be from somewhere else, or its server is gone."""
    folder = workspace.hidden("small", "jobs", "20260101-000000-abcdef")
    folder.mkdir(parents=True)
    (folder / "job.json").write_text(json.dumps({
        "id": folder.name, "kind": "diagnose", "case": "small", "folder": "x", "options": {},
    }))  # fmt: skip
    (folder / "state.json").write_text(json.dumps({"state": "waiting"}))
    (found,) = browser.get("/api/jobs").json()
    assert found["state"] == "interrupted" and not processes


@pytest.mark.slow
def test_a_job_is_cancelled_and_goes_on(browser, workspace):
    asked = {"kind": "back_analyse", "case": "small", "options": {"spacing_m": 0.75}}
    job = browser.post("/api/jobs", json=asked, headers=OURS).json()["id"]
    for _ in range(600):
        if browser.get(f"/api/jobs/{job}").json().get("done", 0) > 1:
            break
        time.sleep(0.05)
    assert browser.post(f"/api/jobs/{job}/cancel", headers=OURS).json()["state"] == "cancelled"
    kept = list(workspace.hidden("small", "runs").glob("**/*"))
    assert kept, "finished simulations stay"
    assert browser.post(f"/api/jobs/{job}/again", headers=OURS).json()["state"] == "running"
    assert browser.post(f"/api/jobs/{job}/again", headers=OURS).status_code == 400
    browser.post(f"/api/jobs/{job}/cancel", headers=OURS)


def test_a_job_whose_process_is_gone_is_interrupted(browser, workspace):
    folder = workspace.hidden("small", "jobs", "20260101-000000-abcdef")
    folder.mkdir(parents=True)
    (folder / "job.json").write_text(json.dumps({
        "id": folder.name, "kind": "diagnose", "case": "small", "folder": "x", "options": {},
    }))  # fmt: skip
    (folder / "state.json").write_text(json.dumps({"state": "running", "process": 2**22 - 1}))
    (found,) = browser.get("/api/jobs").json()
    assert found["state"] == "interrupted" and found["words"].startswith("diagnosis")
    assert "full disk" in found["message"]
    bad = {"kind": "format", "case": "small"}
    assert browser.post("/api/jobs", json=bad, headers=OURS).status_code == 400
    bad = {"kind": "diagnose", "case": "small", "options": {"spacing_m": -1}}
    answer = browser.post("/api/jobs", json=bad, headers=OURS)
    assert answer.status_code == 400 and "spacing_m" in answer.json()["message"]


def test_an_error_of_the_program_is_said_and_the_page_goes_on(browser, live, monkeypatch):
    def broken(*_):
        raise ZeroDivisionError("by zero")

    with browser.websocket_connect(LIVE, headers=OURS) as socket, monkeypatch.context() as patch:
        patch.setattr(live, "_run", broken)
        socket.send_text(json.dumps({"type": "run", "id": 7, "case": "small"}))
        said = json.loads(socket.receive_text())
        assert said["id"] == 7 and "error of the program: ZeroDivisionError" in said["message"]
        socket.send_text(json.dumps({"type": "run", "id": 8, "case": "none"}))
        assert "there is none" in json.loads(socket.receive_text())["message"]
