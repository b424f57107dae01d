"""Text files that are handed in."""

import pytest

from pipeline.cli import InputError
from pipeline.files import read_text


def test_text_is_read_whole(tmp_path):
    path = tmp_path / "a.csv"
    path.write_bytes("\ufeffhöhe\n".encode())
    assert read_text(path, encoding="utf-8-sig") == "höhe\n"


def test_what_is_no_text_is_reported_in_one_line(tmp_path):
    (tmp_path / "latin.csv").write_bytes("höhe\n".encode("latin-1"))
    for name, words in (
        ("latin.csv", "not a UTF-8 text file"),
        ("nowhere.csv", "no such file"),
        (".", "cannot be read: Is a directory"),
    ):
        with pytest.raises(InputError) as caught:
            read_text(tmp_path / name)
        assert str(caught.value) == f"{tmp_path / name}: {words}"
