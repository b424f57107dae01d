from __future__ import annotations

import errno
import json
import os
import re
import resource
import shutil
import signal
from pathlib import Path

import pytest

from flowslide.command_line import main
from flowslide.studio.case_documents import proposed_question, read_documents
from flowslide.studio.jobs import Jobs
from flowslide.studio.whole_files import append_line
from flowslide.studio.workspace import NotKept
from geometry.case import load_case
from pipeline.cli import InputError
from pipeline.files import read_yaml


def test_what_check_doubts_is_doubted_by_the_studio(workspace, capsys):
    """Soil, runout, foot, gap, thin layer: line by line."""
    folder = workspace.folder / "small"
    scene = (folder / "scene.yaml").read_text()
    changed = scene.replace("cohesion_kpa: 1.0", "cohesion_kpa: 2.0e+9").replace(
        "[70.0, 10.0], [60.0, 10.0]", "[69.7, 10.0], [60.0, 10.0]"
    )
    changed = changed.replace("spacing: 1.0", "spacing: 2.0")
    (folder / "scene.yaml").write_text(changed)
    survey = (folder / "measurements.yaml").read_text()
    (folder / "measurements.yaml").write_text(
        survey.replace("toe_left_x_m: 40.0", "toe_left_x_m: 30.0").replace("14.0", "-3.0")
    )
    main(["check", str(folder)])
    printed = re.findall("doubtful: (.*)", capsys.readouterr().out)
    doubts = workspace.read("small")["derived"]["doubts"]
    assert [one["message"] for one in doubts] == printed and len(printed) >= 5
    fields = [one["field"] for one in doubts]
    assert ["materials", "firm", "cohesion_kpa"] in fields and ["spacing"] in fields
    assert ["sets", "field", 0, "toe_runout", "value_m"] in fields


def test_a_case_is_what_its_files_say(workspace):
    case = workspace.read("small")
    assert not case["shipped"] and not case["faults"] and not case["draft"]
    assert case["scene"] == read_yaml(workspace.folder / "small" / "scene.yaml")
    assert case["derived"]["feet"]["left"] == 40.0 and case["derived"]["doubts"] == []
    names = {one["name"]: one["shipped"] for one in workspace.cases()}
    assert names["small"] is False and names["lower_san_fernando"] is True


def test_an_edit_is_written_to_the_files_and_the_first_ones_are_kept(workspace):
    case = workspace.read("small")
    before = (workspace.folder / "small" / "scene.yaml").read_text()
    case["scene"]["materials"]["loose"]["cohesion_kpa"] = 9.0
    assert workspace.save("small", case["revision"], case)
    found = workspace.read("small")
    assert found["scene"]["materials"]["loose"]["cohesion_kpa"] == 9.0
    assert found["revision"] != case["revision"]
    assert workspace.hidden("small", "first", "scene.yaml").read_text() == before
    (line,) = workspace.hidden("small", "journal.jsonl").read_text().splitlines()
    assert json.loads(line)["documents"]["scene"] == case["scene"]


def test_an_edit_that_is_undone_leaves_the_case_as_it_was(workspace):
    """A browser writes 34 where the file had 34.0."""
    case = workspace.read("small")
    other = json.loads(json.dumps(case))
    other["scene"]["materials"]["firm"]["friction_deg"] = 28
    assert workspace.save("small", case["revision"], other)
    other["scene"]["materials"]["firm"]["friction_deg"] = 34
    assert workspace.save("small", workspace.revision("small"), other)
    assert workspace.revision("small") == case["revision"]


def test_an_edit_with_a_fault_is_a_draft_and_the_files_stay(workspace):
    case = workspace.read("small")
    before = (workspace.folder / "small" / "scene.yaml").read_bytes()
    case["scene"]["zones"][0]["polygon"] = [[40.0, 0.0], [70.0, 6.0], [70.0, 0.0], [52.0, 6.0]]
    assert workspace.save("small", case["revision"], case)
    assert (workspace.folder / "small" / "scene.yaml").read_bytes() == before
    found = workspace.read("small")
    assert found["draft"] and found["derived"] is None
    assert found["faults"][0]["document"] == "scene" and "'loose'" in found["faults"][0]["message"]
    assert found["scene"] == case["scene"], "nothing that was drawn is lost"
    case["scene"] = read_yaml(workspace.folder / "small" / "scene.yaml")
    assert workspace.save("small", found["revision"], case)
    assert not workspace.read("small")["draft"]


def test_an_edit_of_files_that_changed_elsewhere_is_not_written(workspace):
    case = workspace.read("small")
    other = workspace.read("small")
    other["scene"]["spacing"] = 1.5
    assert workspace.save("small", other["revision"], other)
    case["scene"]["spacing"] = 3.0
    assert not workspace.save("small", case["revision"], case)
    assert workspace.read("small")["scene"]["spacing"] == 1.5


def test_what_changes_elsewhere_while_an_edit_is_checked_stays(workspace, monkeypatch):
    case, place = workspace.read("small"), workspace.folder / "small" / "scene.yaml"
    check = workspace.faults

    def slow(name, documents):
        place.write_text(place.read_text().replace("spacing: 1.0", "spacing: 1.5"))
        return check(name, documents)

    monkeypatch.setattr(workspace, "faults", slow)
    case["scene"]["spacing"] = 3.0
    assert not workspace.save("small", case["revision"], case)
    assert read_yaml(place)["spacing"] == 1.5


def test_a_measurement_that_does_not_go_with_the_section_is_wrong_at_its_field(workspace):
    case = workspace.read("small")
    entry = case["measurements"]["sets"]["field"][0]
    entry["value_m"] = 190.0
    case["scene"]["domain"]["left"] = "far"
    (fault,) = workspace.faults("small", case)
    assert fault.message.startswith("toe: the toe: -150 lies beyond the end of the drawn ground")
    assert fault.field == ("sets", "field", 0, "toe_runout", "value_m")
    case["measurements"]["sets"]["field"] = [
        {key: entry[key] for key in ("std_is", "confidence", "source")}
        | {"name": "post", "type": "marker_displacement", "x_m": 60.0, "y_m": 6.0, "std_m": 1.0}
    ]
    fault = next(one for one in workspace.faults("small", case) if one.document == "measurements")
    assert fault.message == "post: dx, dy: give at least one of them"
    assert fault.field[-1] == "dx_m"


def test_faults_of_each_document_are_named_in_words_at_their_fields(workspace):
    case = workspace.read("small")
    entry = case["measurements"]["sets"]["field"][0]
    entry |= {"std_m": -1.0, "source": ""}
    case["inversion"]["parameters"][0]["zones"] = ["lose"]
    faults = {one.message: one for one in workspace.faults("small", case)}
    source, std, question = faults
    assert std == "toe: standard deviation must be more than 0 (is -1)"
    assert source == "toe: say where the number is from"
    assert faults[source].field == ("sets", "field", 0, "toe_runout", "source")
    assert "'lose'" in question and not faults[question].field
    del entry["value_m"]
    entry |= {"std_m": 2.0, "source": "map"}
    case["inversion"]["parameters"][0]["high"] = "much"
    words = [one.message for one in workspace.faults("small", case)]
    assert words[0] == "toe: value is missing"
    assert words[1].startswith("S_r: upper bound must be a valid number")


def test_a_survey_is_judged_though_the_section_has_faults(workspace):
    case = workspace.read("small")
    del case["scene"]["materials"]["firm"]["friction_deg"]
    case["measurements"]["sets"]["field"][0]["source"] = ""
    case["inversion"]["parameters"][0]["zones"] = ["lose"]  # judged when the section is right
    assert [one.message for one in workspace.faults("small", case)] == [
        "firm: friction angle is missing",
        "toe: say where the number is from",
    ]


def test_what_does_not_go_together_is_said_in_the_words_of_check(workspace):
    case = workspace.read("small")
    case["measurements"]["initial"]["toe_left_x_m"] = 5000.0
    (fault,) = workspace.faults("small", case)
    assert fault.document == "measurements" and "toe_left_x_m" in fault.message
    assert "/" not in fault.message.split(":")[0], "no temporary folder is shown"


def test_an_outline_is_judged_though_strengths_are_missing(workspace):
    """A bow tie, and two zones one on the other; nothing is known of the soils yet."""
    case = workspace.read("small")
    case["scene"]["materials"] = {"loose": {"liquefied": True}, "firm": {"friction_deg": 99}}
    case["scene"]["water_level"] = "high"
    zones = case["scene"]["zones"]
    zones[0]["polygon"] = [[40.0, 0.0], [70.0, 6.0], [70.0, 0.0], [52.0, 6.0]]
    zones[2]["polygon"][2] = [66.0, 10.0]
    faults = workspace.faults("small", case)
    words = [one.message for one in faults]
    assert words[:5] == [
        "loose: friction angle is missing",
        "loose: residual strength S_r is missing",
        "firm: friction angle must be less than 89 (is 99)",
        "firm: cohesion is missing",
        "pool level must be a valid number, unable to parse string as a number",
    ]
    assert "'loose' is not a simple polygon" in words[5] and faults[5].places
    assert "'crest' and 'back' overlap" in words[6] and faults[6].places


@pytest.mark.parametrize("far", [1e300, -2e6, 1e308])
def test_a_place_at_the_other_end_of_the_world_is_refused(workspace, far):
    case = workspace.read("small")
    case["scene"]["zones"][1]["polygon"][2][1] = far
    del case["scene"]["domain"], case["scene"]["ground"]
    (fault,) = workspace.faults("small", case)
    limit = "at most 1e+06" if far > 0 else "at least -1e+06"
    assert fault.message == f"zone crest: y of vertex 3 must be {limit} (is {far:g})"
    assert fault.zones == ("crest",) and fault.field == ("zones", 1, "polygon", 2, 1)


def test_a_shipped_case_is_copied_before_it_is_edited(workspace):
    case = workspace.read("la_marquesa")
    assert case["shipped"]
    with pytest.raises(InputError, match="copy it"):
        workspace.save("la_marquesa", case["revision"], case)
    workspace.create("mine", "la_marquesa", None)
    assert workspace.read("mine")["scene"] == case["scene"]
    with pytest.raises(InputError, match="is there already"):
        workspace.create("mine", "la_marquesa", None)


@pytest.mark.parametrize("name", ["..", "../small", "a/b", "", ".studio", "x" * 65, "small\0"])
def test_no_name_leads_out_of_the_workspace(workspace, name):
    for act in (workspace.read, workspace.view, lambda n: workspace.create(n, "small", None)):
        with pytest.raises(InputError, match="letters, digits"):
            act(name)


def test_no_link_leads_out_of_the_workspace(workspace, tmp_path):
    outside = tmp_path / "outside"
    outside.mkdir()
    (workspace.folder / "link").symlink_to(outside)
    with pytest.raises(InputError, match="leads out"):
        workspace.read("link")
    hidden = workspace.folder / ".studio"
    hidden.mkdir()
    (hidden / "small").symlink_to(outside)
    with pytest.raises(InputError, match="leads elsewhere"):
        workspace.save_view("small", {"scale": 1})
    assert not list(outside.iterdir())
    with pytest.raises(InputError, match="no picture"):
        workspace.save_file("small", "../x.png", b"")


def _draw(workspace, name, **documents):
    case = workspace.read(name)
    assert workspace.save(name, case["revision"], {**case, **documents})
    return workspace.read(name)


SAND = {"friction_deg": 0.0, "cohesion_kpa": 8.0, "liquefied": True, "source": "CPT 3"}
SECTION = {
    "name": "drawn",
    "zones": [{"name": "a", "material": "sand", "polygon": [[0, 0], [30, 0], [20, 6], [10, 6]]}],
    "materials": {"sand": SAND},
}


def test_a_case_drawn_from_nothing_gets_the_files_of_a_new_case(workspace):
    workspace.create("drawn", None, None)
    case = workspace.read("drawn")
    assert case["faults"][0]["message"] == "no zone is drawn yet" and case["derived"] is None
    assert {"name": "drawn", "shipped": False} in workspace.cases()
    with pytest.raises(InputError, match="to mend first: no zone is drawn yet"):
        workspace.ready("drawn")
    with pytest.raises(InputError, match="there already"):
        workspace.create("drawn", "small", None)

    half = {**SECTION, "materials": {"sand": {}}}
    case = _draw(workspace, "drawn", scene=half)
    assert case["scene"] == half, "a draft is what was drawn"
    assert [one["message"] for one in case["faults"]] == [
        f"sand: {label} is missing" for label in ("friction angle", "cohesion")
    ]

    case = _draw(workspace, "drawn", scene=SECTION)
    assert not case["faults"] and not case["draft"]
    assert case["scene"]["domain"] == {"x_min": -12.0, "x_max": 42.0, "y_max": 7.8, "walls": "open"}
    assert case["scene"]["spacing"] == 0.1 and case["derived"]["points"] > 1000
    assert case["scene"]["ground"]["points"] == [[-12.0, 0.0], [42.0, 0.0]]
    files = {path.name for path in workspace.ready("drawn").iterdir()}
    assert files == {"scene.yaml", "README.md"}
    text = (workspace.folder / "drawn" / "scene.yaml").read_text()
    assert "# Outlines in order." in text and "source: CPT 3" in text

    toe = {"name": "toe", "type": "toe_runout", "side": "left", "value_m": 9.0, "std_m": 1.0,
           "confidence": "assumed", "source": "me"}  # fmt: skip
    profile = {"name": "line", "type": "surface_profile", "file": "after.csv", "std_m": 0.2,
               "confidence": "assumed", "source": "me"}  # fmt: skip
    slip = {"name": "boring", "type": "slip_depth", "x_m": 15.0, "value_m": 4.0, "std_m": 0.5,
            "confidence": "assumed", "source": "me"}  # fmt: skip
    survey = {"case": "drawn", "upstream": "left", "initial": {}, "default_set": "field",
              "sets": {"field": [toe, profile, slip]}}  # fmt: skip
    tables = {"after.csv": "x_m,y_m\n-21,0\n5,3\n30,0\n"}
    question = proposed_question({**case, "measurements": survey, "tables": tables})
    assert question["fit"] == ["toe"] and question["parameters"][0]["zones"] == ["a"]
    case = _draw(workspace, "drawn", measurements=survey, tables=tables, inversion=question)
    assert not case["faults"]
    assert case["scene"]["domain"]["x_min"] <= -21.0, "the profile has room"
    kinds = {one["name"]: one["kind"] for one in case["derived"]["marks"]}
    assert kinds == {"toe": "distance", "line": "line", "boring": "height"}
    assert case["derived"]["marks"][-1]["surface"] == 6.0
    assert (workspace.folder / "drawn" / "after.csv").read_text() == tables["after.csv"]
    assert "# share one value" in (workspace.folder / "drawn" / "inversion.yaml").read_text()


def test_all_faults_of_a_section_are_named_with_their_places(workspace):
    case = workspace.read("small")
    zones = case["scene"]["zones"]
    zones[0]["polygon"][0] = [39.0, -3.0]
    zones[2]["polygon"][2] = [66.0, 10.0]
    faults = workspace.faults("small", case)
    assert [one.zones for one in faults] == [("loose",), ("loose", "back"), ("crest", "back")]
    for fault in faults:
        (outline,) = fault.places
        assert len(outline) >= 3, fault.message
    assert max(y for _, y in faults[0].places[0]) == 0.0, "what lies below the ground"
    assert min(x for x, _ in faults[2].places[0]) >= 66.0


def test_comments_of_the_files_survive_an_edit(workspace):
    workspace.create("mine", "lower_san_fernando", None)
    before = (workspace.folder / "mine" / "scene.yaml").read_text()
    case = workspace.read("mine")
    case["scene"]["zones"][0]["polygon"][0] = [97.5, 5.0]
    case["scene"]["materials"]["core"]["cohesion_kpa"] = 50.0
    assert workspace.save("mine", case["revision"], case)
    after = (workspace.folder / "mine" / "scene.yaml").read_text()
    assert after.count("#") == before.count("#") and "[[97.5, 5.0]," in after
    assert workspace.read("mine")["scene"]["domain"] == case["scene"]["domain"]


@pytest.mark.parametrize("table", ["../after.csv", "a/b.csv", "after.txt", "", ".csv"])
def test_no_table_leads_out_of_the_case(workspace, table):
    case = workspace.read("small")
    with pytest.raises(InputError, match="table"):
        workspace.save("small", case["revision"], {**case, "tables": {table: "x_m,y_m\n"}})
    with pytest.raises(InputError, match="table"):
        workspace.faults("small", {**case, "tables": {table: "x_m,y_m\n"}})


@pytest.mark.parametrize("tables", [["after.csv"], {"after.csv": 3}, "after.csv"])
def test_tables_are_texts_by_name(workspace, tables):
    case = workspace.read("small")
    with pytest.raises(InputError, match="must be the texts"):
        workspace.save("small", case["revision"], {**case, "tables": tables})


def test_a_table_that_is_a_link_elsewhere_is_not_shown(workspace, tmp_path):
    """As it may come in a folder from somewhere else."""
    (tmp_path / "secret.csv").write_text("of the disk")
    (workspace.folder / "small" / "own.csv").write_text("x_m,y_m\n")
    (workspace.folder / "small" / "after.csv").symlink_to(tmp_path / "secret.csv")
    assert workspace.read("small")["tables"] == {"own.csv": "x_m,y_m\n"}


def test_files_that_are_changed_beside_a_draft_are_told(workspace):
    case = workspace.read("small")
    case["scene"]["materials"]["loose"]["cohesion_kpa"] = -3
    assert workspace.save("small", case["revision"], case)
    assert workspace.read("small")["beside"] is None
    scene = workspace.place("small") / "scene.yaml"
    scene.write_text(scene.read_text().replace("friction_deg: 34.0", "friction_deg: 31.0"))
    found = workspace.read("small")
    assert found["scene"]["materials"]["loose"]["cohesion_kpa"] == -3
    assert found["beside"]["scene"]["materials"]["firm"]["friction_deg"] == 31
    # The draft that is kept all the same is one on these files.
    assert workspace.save("small", found["revision"], found)
    assert workspace.read("small")["beside"] is None


def test_an_edit_that_is_killed_while_it_is_written_is_written_by_the_next_look(
    workspace, monkeypatch
):
    case = workspace.read("small")
    case["scene"]["zones"][0]["name"] = "renamed"
    case["inversion"]["parameters"][0]["zones"] = ["renamed"]

    def killed(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("flowslide.studio.workspace.write_case", killed)
    with pytest.raises(KeyboardInterrupt):
        workspace.save("small", case["revision"], case)
    assert workspace.hidden("small", "draft.json").is_file()
    monkeypatch.undo()
    # A slide and a job are of the files: what the page shows is in them.
    found = workspace.read("small")
    assert not found["draft"] and not found["faults"]
    assert read_documents(workspace.place("small"))["inversion"] == case["inversion"]
    assert workspace.ready("small") == workspace.place("small")


def test_an_edit_that_is_cut_short_is_written_before_a_job_is_asked(workspace, monkeypatch):
    case = workspace.read("small")
    case["scene"]["spacing"] = 2.0

    def killed(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("flowslide.studio.workspace.write_case", killed)
    with pytest.raises(KeyboardInterrupt):
        workspace.save("small", case["revision"], case)
    monkeypatch.undo()
    assert workspace.case(workspace.ready("small").name).scene.spacing == 2.0


def test_a_disk_that_is_full_is_no_edit_of_somebody_else(workspace, monkeypatch):
    """The draft was written before the files had no room."""
    case = workspace.read("small")
    case["scene"]["spacing"] = 2.0

    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr("flowslide.studio.workspace.write_case", full)
    with pytest.raises(NotKept, match="No space left on device") as told:
        workspace.save("small", case["revision"], case)
    monkeypatch.undo()
    assert workspace.save("small", told.value.revision, case)
    assert read_documents(workspace.place("small"))["scene"]["spacing"] == 2.0


def test_what_a_case_was_at_first_is_kept_whole_or_not_yet(workspace, monkeypatch):
    case, copy = workspace.read("small"), shutil.copy2

    def full(source, target):
        if Path(source).name == "scene.yaml":
            Path(target).touch()
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(source))
        return copy(source, target)

    monkeypatch.setattr(shutil, "copy2", full)
    case["scene"]["spacing"] = 2.0
    with pytest.raises(OSError, match="No space left on device") as told:
        workspace.save("small", case["revision"], case)
    assert told.value.errno == errno.ENOSPC  # one fault, in one line
    assert not list(workspace.hidden("small").glob("*first*"))
    monkeypatch.undo()
    before = (workspace.place("small") / "scene.yaml").read_text()
    assert workspace.save("small", case["revision"], case)
    assert workspace.hidden("small", "first", "scene.yaml").read_text() == before


def test_nothing_is_drafted_where_nothing_may_be_written(workspace, monkeypatch):
    case, access = workspace.read("small"), os.access
    own = workspace.place("small")
    monkeypatch.setattr(os, "access", lambda path, mode: path != own and access(path, mode))
    case["scene"]["spacing"] = 2.0
    with pytest.raises(InputError, match="small: cannot be written: Permission denied"):
        workspace.save("small", case["revision"], case)
    assert workspace.revision("small") == case["revision"]


def test_a_journal_has_whole_lines(tmp_path):
    path = tmp_path / "journal.jsonl"
    append_line(path, "first")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    heard = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (10, before[1]))
        with pytest.raises(OSError, match="No space left|too large"):
            append_line(path, "second")
        assert path.read_text() == "first\n"
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, heard)
    append_line(path, "second")
    assert path.read_text() == "first\nsecond\n"


def test_two_tabs_with_drafts_notice_each_other(workspace):
    case, other = workspace.read("small"), workspace.read("small")
    case["scene"]["zones"][0]["polygon"] = [[0, 0], [1, 1]]
    assert workspace.save("small", case["revision"], case)
    other["scene"]["spacing"] = 3.0
    assert workspace.revision("small") != other["revision"]
    assert not workspace.save("small", other["revision"], other)


@pytest.mark.parametrize("part", ["scene", "measurements", "inversion", "diagnosis"])
@pytest.mark.parametrize(
    "content", [[1], {"sets": 3}, {"zones": 3}, {"zones": [{}]}, "x", {"a": None}]
)
def test_whatever_is_sent_is_a_fault_and_no_crash(workspace, part, content):
    case = {**workspace.read("small"), part: content}
    assert workspace.faults("small", case)
    assert workspace.save("small", case["revision"], case)
    assert workspace.read("small")["faults"]


def test_a_base_that_nobody_drew_follows_the_section(workspace):
    workspace.create("drawn", None, None)
    case = _draw(workspace, "drawn", scene=SECTION)
    scene = case["scene"]
    scene["zones"][0]["polygon"] = [[0, 1.5], [30, 1.5], [20, 6], [10, 6]]
    case = _draw(workspace, "drawn", scene=scene)
    assert {y for _, y in case["scene"]["ground"]["points"]} == {1.5}
    drawn = [[-20, 0.5], [60, 0.5]]
    scene = case["scene"]
    scene["ground"]["points"] = drawn
    case = _draw(workspace, "drawn", scene=scene)
    scene["zones"][0]["polygon"] = [[0, 2.0], [30, 2.0], [20, 6], [10, 6]]
    assert _draw(workspace, "drawn", scene=scene)["scene"]["ground"]["points"] == drawn


def test_a_copy_has_what_is_not_in_the_files_yet(workspace):
    workspace.create("drawn", None, None)
    half = {**SECTION, "materials": {"sand": {}}}
    _draw(workspace, "drawn", scene=half)
    workspace.create("again", "drawn", None)
    assert workspace.read("again")["scene"] == half
    whole = _draw(workspace, "again", scene=SECTION)
    assert not whole["faults"] and workspace.read("drawn")["scene"] == half


def test_a_new_case_that_is_killed_before_its_files_are_written_is_shown(workspace, monkeypatch):
    workspace.create("drawn", None, None)
    case = workspace.read("drawn")

    def killed(*args):
        raise KeyboardInterrupt

    monkeypatch.setattr("flowslide.studio.workspace.write_case", killed)
    with pytest.raises(KeyboardInterrupt):
        workspace.save("drawn", case["revision"], {**case, "scene": SECTION})
    monkeypatch.undo()
    found = workspace.read("drawn")
    assert found["scene"]["zones"] == SECTION["zones"]
    assert not found["faults"] and found["derived"]["points"] > 1000


def test_a_case_is_renamed_with_all_that_belongs_to_it(workspace, monkeypatch):
    monkeypatch.setattr(Jobs, "_launch", lambda *args: None)
    case = workspace.read("small")
    case["scene"]["spacing"] = 2.0
    assert workspace.save("small", case["revision"], case)
    jobs = Jobs(workspace)
    job = jobs.start("simulate", "small", {})["id"]
    workspace.rename("small", "other")
    assert workspace.read("other")["scene"]["spacing"] == 2.0
    assert workspace.hidden("other", "journal.jsonl").is_file()
    assert jobs.state(job)["case"] == "other"
    asked = json.loads(workspace.hidden("other", "jobs", job, "job.json").read_text())
    assert load_case(asked["folder"]).scene.spacing == 2.0
    assert not (workspace.folder / "small").exists()
    for name, words in (
        ("la_marquesa", "ships"), ("../x", "letters"), ("small", "there is none"),
    ):  # fmt: skip
        with pytest.raises(InputError, match=words):
            workspace.rename(name, "third")
        with pytest.raises(InputError, match=words):
            workspace.remove(name)
    with pytest.raises(InputError, match="there already"):
        workspace.rename("other", "la_marquesa")


def test_a_case_that_is_removed_is_kept_aside(workspace):
    workspace.create("drawn", None, None)
    kept = workspace.remove("drawn")
    assert (kept / ".studio" / "draft.json").is_file()
    assert kept.is_relative_to(workspace.folder / ".studio")
    scene = (workspace.folder / "small" / "scene.yaml").read_bytes()
    assert (workspace.remove("small") / "scene.yaml").read_bytes() == scene
    assert not [one for one in workspace.cases() if not one["shipped"]]
    workspace.create("drawn", None, None)
    assert workspace.read("drawn")["scene"]["zones"] == []


def test_a_job_keeps_the_files_as_they_were(workspace, monkeypatch):
    monkeypatch.setattr(Jobs, "_launch", lambda *args: None)
    case = workspace.read("small")
    job = Jobs(workspace).start("simulate", "small", {})
    case["scene"]["materials"]["loose"]["cohesion_kpa"] = 20.0
    assert workspace.save("small", case["revision"], case)
    (kept,) = workspace.hidden("small", "jobs", job["id"], "case").iterdir()
    assert load_case(kept).scene.materials["loose"].cohesion_kpa == 8.0
    assert load_case(kept).title == load_case(workspace.folder / "small").title
    assert job["revision"] == case["revision"]
    assert Jobs(workspace).start("simulate", "small", {})["revision"] != job["revision"]


def test_a_link_to_everything_is_not_copied(workspace, tmp_path, monkeypatch):
    """As it may come in a folder from somewhere else; a link to a file is one of the case."""
    monkeypatch.setattr(Jobs, "_launch", lambda *args: None)
    (tmp_path / "disk").mkdir()
    (tmp_path / "disk" / "file.txt").write_text("of the disk")
    (workspace.folder / "small" / "everything").symlink_to(tmp_path / "disk")
    (workspace.folder / "small" / "notes.txt").symlink_to(tmp_path / "disk" / "file.txt")
    job = Jobs(workspace).start("simulate", "small", {})
    (kept,) = workspace.hidden("small", "jobs", job["id"], "case").iterdir()
    assert not (kept / "everything").exists() and (kept / "notes.txt").read_text() == "of the disk"
    assert not workspace.faults("small", workspace.read("small"))
    assert (tmp_path / "disk" / "file.txt").read_text() == "of the disk"


@pytest.mark.parametrize("name", ["log.txt", "inversion"])
def test_a_job_that_came_with_a_folder_writes_nowhere_else(workspace, tmp_path, name, monkeypatch):
    started = []
    monkeypatch.setattr("flowslide.studio.jobs.subprocess.Popen", started.append)
    with monkeypatch.context() as patch:
        patch.setattr(Jobs, "_launch", lambda *args: None)
        job = Jobs(workspace).start("back_analyse", "small", {})["id"]
    place = workspace.hidden("small", "jobs", job, name)
    place.symlink_to(tmp_path / "elsewhere")
    with pytest.raises(InputError, match=f"{name} is a link that leads elsewhere"):
        Jobs(workspace).again(job)
    assert not started and not (tmp_path / "elsewhere").exists()


def test_a_job_that_came_with_a_folder_ends_no_process(workspace, monkeypatch):
    """It says that it is one of ours, by its number and name: every process has some of both."""
    folder = workspace.hidden("small", "jobs", "python")
    folder.mkdir(parents=True)
    asked = {"id": "python", "kind": "simulate", "case": "small", "options": {}}
    (folder / "job.json").write_text(json.dumps(asked))
    (folder / "state.json").write_text(json.dumps({"state": "running", "process": os.getpid()}))
    monkeypatch.setattr(os, "killpg", None)
    assert b"python" in Path(f"/proc/{os.getpid()}/cmdline").read_bytes()
    assert Jobs(workspace).cancel("python")["state"] == "interrupted"
