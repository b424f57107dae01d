"""A folder of results is tried before the work begins."""

import pytest

from pipeline.cli import InputError
from pipeline.files import ready_folder


def test_it_is_made_with_those_above_it(tmp_path):
    assert ready_folder(tmp_path / "a" / "b", ["c.png"]).is_dir()
    assert ready_folder(tmp_path / "a" / "b", ["c.png"]) == tmp_path / "a" / "b"


def test_what_cannot_be_written_is_reported(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="file.out: cannot be written: Not a directory"):
        ready_folder(tmp_path / "file" / "out", [])
    with pytest.raises(InputError, match="file: cannot be written: File exists"):
        ready_folder(tmp_path / "file", [])
    (tmp_path / "out" / "c.png").mkdir(parents=True)
    with pytest.raises(InputError, match="c.png: is a folder; a file is to be written there"):
        ready_folder(tmp_path / "out", ["b.png", "c.png"])
