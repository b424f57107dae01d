from __future__ import annotations

import json

import pytest

from pipeline.cli import InputError
from pipeline.files import read_yaml


def test_a_case_is_what_its_files_say(workspace):
    case = workspace.read("small")
    assert not case["shipped"] and not case["faults"] and not case["draft"]
    assert case["scene"] == read_yaml(workspace.folder / "small" / "scene.yaml")
    assert case["derived"]["feet"]["left"] == 40.0
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


def test_faults_of_each_document_are_named_in_the_words_of_check(workspace):
    case = workspace.read("small")
    case["measurements"]["sets"]["field"][0]["std_m"] = -1.0
    case["inversion"]["parameters"][0]["zones"] = ["lose"]
    faults = {one.document: one.message for one in workspace.faults("small", case)}
    assert set(faults) == {"measurements", "inversion"}
    assert "std_m" in faults["measurements"] and "'lose'" in faults["inversion"]
    assert "/" not in faults["measurements"].split(":")[0], "no temporary folder is shown"


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
