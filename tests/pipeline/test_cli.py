"""Exit codes and one-line errors, as a user meets them."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys

import pytest

from pipeline.cli import InputError, WorkFailed, add_common, base_parser, main_exit
from pipeline.files import write_text


def leave(func) -> int:
    with pytest.raises(SystemExit) as caught:
        main_exit(func, [])
    return caught.value.code


def fail_with(error):
    def main(argv):
        raise error

    return main


def test_success():
    assert leave(lambda argv: None) == 0
    assert leave(lambda argv: 0) == 0
    assert leave(lambda argv: 1) == 1


@pytest.mark.parametrize(
    ("error", "code"),
    [(InputError("bad\nvalue"), 2), (WorkFailed("bad  value"), 1), (KeyboardInterrupt(), 130)],
)
def test_errors_are_one_line(capsys, error, code):
    assert leave(fail_with(error)) == code
    lines = capsys.readouterr().err.splitlines()
    assert lines == ["error: interrupted" if code == 130 else "error: bad value"]


def test_a_mistake_of_ours_is_not_hidden():
    with pytest.raises(ZeroDivisionError):
        main_exit(fail_with(ZeroDivisionError()), [])


@pytest.mark.parametrize(
    ("error", "line"),
    [
        (PermissionError(13, "Permission denied", "a.csv"), "error: a.csv: Permission denied"),
        (OSError(28, "No space left\non device"), "error: No space left on device"),
    ],
)
def test_what_the_system_refuses_is_bad_input(capsys, error, line):
    assert leave(fail_with(error)) == 2
    assert capsys.readouterr().err.splitlines() == [line]


def test_an_error_that_the_system_has_not_numbered_is_ours():
    with pytest.raises(OSError, match="a library says"):
        main_exit(fail_with(OSError("a library says")), [])


@pytest.mark.parametrize("length", [250, 300])
def test_a_name_that_is_too_long_is_reported_as_it_was_given(capsys, tmp_path, length):
    path = tmp_path / ("a" * length)  # of 250 letters, it is the temporary name that is too long
    assert leave(lambda argv: write_text(path, "text")) == 2
    assert capsys.readouterr().err.splitlines() == [f"error: {path}: File name too long"]


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no device that is always full")
def test_output_to_a_full_disk_is_one_line(root):
    done = subprocess.run(
        f"{sys.executable} -m flowslide settings check > /dev/full", shell=True, cwd=root,
        stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert done.returncode == 2
    assert done.stderr == "error: No space left on device\n"


def test_common_options():
    parser = add_common(base_parser("test", "A test."))
    arguments = parser.parse_args(["--set", "a=1", "--set", "b=2", "--config", "c.yaml", "--quiet"])
    assert arguments.overrides == ["a=1", "b=2"]
    assert arguments.config == "c.yaml" and arguments.quiet


def test_options_are_not_abbreviated_even_in_sub_commands(capsys):
    parser = base_parser("test", "A test.")
    add_common(parser.add_subparsers().add_parser("go"))
    with pytest.raises(SystemExit) as caught:
        parser.parse_args(["go", "--conf", "x"])
    assert caught.value.code == 2
    assert len(capsys.readouterr().err.splitlines()) == 1


@pytest.mark.parametrize(
    "arguments",
    [
        ["check", "--config", "missing.yaml"],
        ["check", "--set", "simulation.courant=-1"],
        ["check", "--set", "simulation.courant=.nan"],
        ["check", "--sett", "x"],
        ["chek"],
    ],
)
def test_bad_input_ends_with_2_and_one_line(run_module, arguments):
    done = run_module("flowslide", "settings", *arguments)
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1 and "Traceback" not in done.stderr
    assert done.stdout == ""


def test_check_prints_the_whole_configuration(run_module, tmp_path):
    done = run_module("flowslide", "settings", "check", "--set", "simulation.courant=0.25")
    assert done.returncode == 0 and "courant: 0.25" in done.stdout
    (tmp_path / "again.yaml").write_text(done.stdout)
    again = run_module("flowslide", "settings", "check", "--config", tmp_path / "again.yaml")
    assert again.stdout == done.stdout


def test_schema_is_written(run_module, tmp_path, root):
    (tmp_path / "config").mkdir()
    assert run_module("flowslide", "schema", "--write", cwd=tmp_path).returncode == 0
    written = (tmp_path / "config" / "config.schema.json").read_text()
    assert json.loads(written)["properties"]["simulation"]


def test_a_reader_that_goes_away_is_no_traceback(root):
    script = f"{sys.executable} -m flowslide schema | head -1"
    done = subprocess.run(
        script, shell=True, cwd=root, env=dict(os.environ), capture_output=True, text=True
    )
    assert done.stdout == "{\n" and done.stderr == ""


WAITS = """
import sys, time
from pipeline.cli import main_exit
def main(argv):
    try:
        print("ready", flush=True)
        time.sleep(60)
    finally:
        print("tidied up", flush=True)
main_exit(main)
"""


@pytest.mark.parametrize(("signum", "code"), [(signal.SIGTERM, 143), (signal.SIGHUP, 129)])
def test_what_is_asked_to_end_tidies_up(root, signum, code):
    process = subprocess.Popen(
        [sys.executable, "-c", WAITS], cwd=root, stdout=subprocess.PIPE, text=True
    )
    assert process.stdout.readline() == "ready\n"
    process.send_signal(signum)
    said, _ = process.communicate(timeout=30)
    assert (said, process.returncode) == ("tidied up\n", code)


@pytest.mark.parametrize(
    ("signum", "code", "line"),
    [(signal.SIGINT, 130, "error: interrupted\n"), (signal.SIGTERM, 143, "")],
)
def test_an_end_that_a_library_takes_for_its_own_failure(root, signum, code, line):
    """As Python does with an extension that is interrupted while it loads."""
    loading = WAITS.replace(
        "finally:",
        "except BaseException:\n        raise ImportError('initialization failed')\n    finally:",
    )
    process = subprocess.Popen(
        [sys.executable, "-c", loading], cwd=root, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        text=True,
    )  # fmt: skip
    assert process.stdout.readline() == "ready\n"
    process.send_signal(signum)
    said, complaint = process.communicate(timeout=30)
    assert (said, complaint, process.returncode) == ("tidied up\n", line, code)


def test_a_failure_that_nobody_asked_for_is_a_traceback(root):
    failing = WAITS.replace("time.sleep(60)", "raise ImportError('initialization failed')")
    done = subprocess.run([sys.executable, "-c", failing], cwd=root, capture_output=True, text=True)
    assert done.returncode == 1 and done.stderr.endswith("ImportError: initialization failed\n")


def test_under_nohup_a_closed_terminal_ends_nothing(root):
    ignoring = "import signal; signal.signal(signal.SIGHUP, signal.SIG_IGN)\n"
    asking = WAITS.replace("time.sleep(60)", "print(signal.getsignal(signal.SIGHUP).name)")
    done = subprocess.run(
        [sys.executable, "-c", ignoring + asking], cwd=root, capture_output=True, text=True
    )
    assert done.stdout == "ready\nSIG_IGN\ntidied up\n", done.stderr


@pytest.mark.parametrize("closed", [">&-", "2>&-", ">&- 2>&-"])
def test_closed_streams_are_no_traceback(root, tmp_path, closed):
    words = f"{sys.executable} -m flowslide check case_histories/lower_san_fernando {closed}"
    done = subprocess.run(["bash", "-c", words], cwd=root, capture_output=True, text=True)
    assert done.returncode == 0 and "Traceback" not in done.stdout + done.stderr
