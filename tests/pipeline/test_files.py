"""Files are whole or absent; YAML and JSON are checked while they are read."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from pydantic import BaseModel

from pipeline import files
from pipeline.cli import InputError, WorkFailed
from pipeline.files import (
    atomic_path,
    content_hash,
    only_one,
    parse_yaml,
    read_json,
    read_yaml,
    write_json,
    write_text,
    yaml_text,
)


def names(folder: Path) -> list[str]:
    return sorted(entry.name for entry in folder.iterdir())


def test_a_folder_that_cannot_be_made_is_reported_in_a_line(tmp_path):
    (tmp_path / "file").touch()
    with (
        pytest.raises(InputError, match="file/folder: cannot be written: Not a directory"),
        atomic_path(tmp_path / "file" / "folder" / "a.txt"),
    ):
        raise AssertionError("never gets here")


def test_atomic_path_makes_the_folder_and_keeps_the_suffix(tmp_path):
    target = tmp_path / "deep" / "er" / "picture.png"
    with atomic_path(target) as temporary:
        assert temporary.suffix == ".png"
        assert temporary.parent == target.parent
        temporary.write_bytes(b"x")
        assert not target.exists()
    assert target.read_bytes() == b"x"
    assert names(target.parent) == ["picture.png"]


def test_a_failed_write_leaves_the_old_file(tmp_path):
    target = tmp_path / "a.json"
    write_json(target, {"a": 1})
    with pytest.raises(RuntimeError), atomic_path(target) as temporary:
        temporary.write_text("half")
        raise RuntimeError
    assert read_json(target) == {"a": 1}
    assert names(tmp_path) == ["a.json"]


def test_a_full_disk_names_the_file_and_leaves_the_old_one(tmp_path, monkeypatch):
    def full(descriptor):
        raise OSError(errno.ENOSPC, "No space left on device")

    target = tmp_path / "a.txt"
    write_text(target, "old")
    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space left on device") as caught:
        write_text(target, "new")
    assert caught.value.filename == str(target)
    assert names(tmp_path) == ["a.txt"] and target.read_text() == "old"


def test_a_write_that_never_happened_is_an_error(tmp_path):
    with pytest.raises(FileNotFoundError), atomic_path(tmp_path / "a.txt"):
        pass
    assert names(tmp_path) == []


def test_a_lock_that_is_a_link_empties_nothing(tmp_path):
    """As it may come in a folder from somewhere else."""
    kept = tmp_path / "kept.txt"
    kept.write_text("mine")
    (tmp_path / "results").mkdir()
    (tmp_path / "results" / "lock").symlink_to(kept)
    with only_one(tmp_path / "results", "another"), pytest.raises(WorkFailed, match="another"):
        with only_one(tmp_path / "results", "another"):
            pass
    assert kept.read_text() == "mine"


def start_endless_write(target: Path) -> subprocess.Popen:
    script = f"""
import time
from pipeline.cli import main_exit
from pipeline.files import atomic_path
def main(argv):
    with atomic_path({str(target)!r}) as temporary:
        temporary.write_text("half")
        print("writing", flush=True)
        time.sleep(60)
main_exit(main)
"""
    process = subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "writing\n"
    return process


def test_a_terminated_write_leaves_nothing(tmp_path):
    process = start_endless_write(tmp_path / "a.txt")
    process.send_signal(signal.SIGTERM)
    assert process.wait(20) == 143
    process.stdout.close()
    assert names(tmp_path) == []


def test_a_killed_write_leaves_no_file_and_the_next_write_sweeps_up(tmp_path):
    target = tmp_path / "a.txt"
    process = start_endless_write(target)
    process.kill()
    process.wait(20)
    process.stdout.close()
    assert not target.exists()
    assert len(names(tmp_path)) == 1  # nobody can tidy up after a SIGKILL at once
    write_text(target, "whole")
    assert names(tmp_path) == ["a.txt"]


def test_the_temporary_file_of_a_living_process_is_left_alone(tmp_path):
    target = tmp_path / "a.txt"
    process = start_endless_write(target)
    write_text(target, "ours")
    time.sleep(0.05)
    assert len(names(tmp_path)) == 2
    process.terminate()
    process.wait(20)
    process.stdout.close()
    assert names(tmp_path) == ["a.txt"]


def test_json_comes_back(tmp_path):
    class Point(BaseModel):
        x: float

    write_json(
        tmp_path / "a.json", {"array": np.arange(3), "number": np.float32(0.5), "p": Point(x=1)}
    )
    assert read_json(tmp_path / "a.json") == {"array": [0, 1, 2], "number": 0.5, "p": {"x": 1.0}}


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_json_is_not_written_with_what_is_no_number(tmp_path, value):
    with pytest.raises(ValueError):
        write_json(tmp_path / "a.json", {"a": value})
    assert names(tmp_path) == []


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('{"a": NaN}', "NaN"),
        ('{"a": -Infinity}', "Infinity"),
        ('{"a": 1e999}', "1e999"),
        ('{"a": 1, "a": 2}', "'a' is given twice"),
        ('{\n"a": }', "line 2"),
        ("[" * 200_000, "nested more than 100 deep"),
        ("[" * 102 + "]" * 102, "nested more than 100 deep"),
        ("9" * 5000, "an integer of 5000 digits: at most 300"),
        ("-" + "9" * 400, "an integer of 400 digits: at most 300"),
    ],
)
def test_bad_json_is_one_line_that_names_the_file(tmp_path, text, message):
    path = tmp_path / "bad.json"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        read_json(path)
    assert str(path) in str(caught.value) and message in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a: 1\nb: .nan", "line 2: .nan"),
        ("a: [1, -.inf]", "-.inf"),
        ("a: 1e999", "1e999"),
        ("a: 1\na: 2", "line 2: the key 'a' is given twice"),
        ("x: {b: 1, b: 1}", "'b' is given twice"),
        ("1: x", "quote it"),
        ("a: [", "not valid YAML"),
        ("a: !!python/object:os.system x", "not valid YAML"),
        ("a: !!float x", "not valid YAML"),
        ("a: \x00", "not valid YAML"),
        ("a: !!float ''", "a value does not fit its tag"),
        ("a: !!bool maybe", "a value does not fit its tag"),
        ("a: !!timestamp soon", "a value does not fit its tag"),
        ("a: !!set [1]", "a value does not fit its tag"),
        ('a: "\\UFFFFFFFF"', "not valid YAML"),
        ("[" * 5000, "nested more than 100 deep"),
        ("{a: " * 102 + "}" * 102, "nested more than 100 deep"),
        ("a: &within [*within, *within]", "nested more than 100 deep"),
        ("a: 1\nb: " + "9" * 5000, "line 2: an integer of 5000 digits: at most 300"),
    ],
)
def test_bad_yaml_names_the_file_and_the_line(tmp_path, text, message):
    path = tmp_path / "bad.yaml"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        read_yaml(path)
    assert str(path) in str(caught.value) and message in str(caught.value)


def test_yaml_means_what_it_looks_like():
    text = "a: 1e-5\nb: no\nc: 010\nd: ~\ne: 1:30\nf: 2026-01-01\ng: true\nh: -.5\ni: [1, 2.0]"
    assert parse_yaml(text, name="test") == {
        "a": 1e-5,
        "b": "no",
        "c": 10,
        "d": None,
        "e": "1:30",
        "f": "2026-01-01",
        "g": True,
        "h": -0.5,
        "i": [1, 2.0],
    }


def test_what_is_nested_and_large_within_reason_is_read(tmp_path):
    text = "[" * 100 + "9" * 300 + "]" * 100
    (tmp_path / "a.json").write_text(text)
    assert read_json(tmp_path / "a.json") == parse_yaml(text, name="test")


@pytest.mark.parametrize(("first", "next_one"), [("[1]", "[{}]"), ("{a: 1}", "{{<<: [{}]}}")])
def test_aliases_count_as_often_as_they_stand_for_something(first, next_one):
    """Lists of ten of the list before, or mappings merged of ten: lines become a million values."""
    lines = [f"- &a0 {first}"]
    for n in range(1, 7):
        lines.append(f"- &a{n} " + next_one.format(", ".join(10 * [f"*a{n - 1}"])))
    assert len(parse_yaml("\n".join(lines[:4]), name="test")) == 4
    with pytest.raises(
        InputError, match="test: line .: more than 100,000 values, the most that is read"
    ):
        parse_yaml("\n".join(lines), name="test")


def test_a_file_that_is_too_large_is_refused(tmp_path, monkeypatch):
    write_text(tmp_path / "a.yaml", "[" + "1, " * 1000 + "1]")
    assert len(read_yaml(tmp_path / "a.yaml")) == 1001
    monkeypatch.setattr(files, "_MOST_VALUES", 1001)
    with pytest.raises(InputError, match=r"a\.yaml: line 1: more than 1,001 values, the most that"):
        read_yaml(tmp_path / "a.yaml")
    monkeypatch.setattr(files, "MOST_CHARACTERS", 3000)
    with pytest.raises(InputError, match=r"a\.yaml: more than 0 MB of text"):
        read_yaml(tmp_path / "a.yaml")


def test_yaml_merge_keys_work():
    text = "base: &base {x: 1, y: 2}\nother: {<<: *base, y: 3}"
    assert parse_yaml(text, name="test")["other"] == {"x": 1, "y": 3}


@pytest.mark.parametrize("read", [read_yaml, read_json])
def test_a_file_that_cannot_be_read(tmp_path, read):
    with pytest.raises(InputError, match="no such file"):
        read(tmp_path / "missing")
    with pytest.raises(InputError, match="cannot be read"):
        read(tmp_path)
    (tmp_path / "binary").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="UTF-8"):
        read(tmp_path / "binary")


def test_content_hash_sees_content_and_nothing_else():
    assert content_hash({"a": 1, "b": [1.5]}) == content_hash({"b": np.array([1.5]), "a": 1})
    assert content_hash({"a": 1}) != content_hash({"a": 2})
    assert len(content_hash(None)) == 16
    with pytest.raises(TypeError, match="object has no JSON form"):
        content_hash(object())


def test_written_files_have_ordinary_rights(tmp_path):
    write_text(tmp_path / "a.txt", "x")
    mask = os.umask(0)
    os.umask(mask)
    assert (tmp_path / "a.txt").stat().st_mode & 0o777 == 0o666 & ~mask


def test_a_folder_in_the_place_of_a_file_is_reported(tmp_path):
    with pytest.raises(InputError, match="is a folder; a file is to be written there"):
        write_text(tmp_path, "text")
    assert tmp_path.is_dir() and not list(tmp_path.iterdir())


@pytest.mark.parametrize("text", ["80601e8423623564", "1e5", "007", "null", "yes", "~", "<<", ".5"])
def test_text_that_looks_like_a_number_stays_text(text):
    assert parse_yaml(yaml_text({"key": text}), name="x.yaml") == {"key": text}
