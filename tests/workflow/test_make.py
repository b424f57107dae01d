"""`make lsfd` as a user types it: progress in a log, and one line for every way to fail."""

from __future__ import annotations

import fcntl
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow
ROOT = Path(__file__).resolve().parents[2]

#: Said by the stand-in below while it works, and where it is killed.
WORKING = "Lower San Fernando: 3/9, 1 s, about 2 s left"
SLOW = f'''
"""Stand-in for inversion: works until the file `go` is there."""
import os
import sys
import time
from pathlib import Path
from pipeline.cli import main_exit
out = Path(sys.argv[sys.argv.index("--out") + 1])
out.mkdir(parents=True, exist_ok=True)
def main(argv):
    if sys.argv[1] == "classical":
        (out / "classical.json").write_text("{{}}")
        return
    Path("started").write_text(str(os.getpid()))
    print({WORKING!r}, file=sys.stderr, flush=True)
    while not Path("go").exists():
        time.sleep(0.05)
    for name in ("result.json", "history.csv", "sections.npz", "run.h5", "report.html"):
        (out / name).write_text("made")
    print("S_r 26 kPa")
main_exit(main)
'''
FAILING = '''
"""Stand-in for inversion: refuses the case."""
import sys
print("a line before", file=sys.stderr)
print("error: scene.yaml: spacing: -1: more than 0", file=sys.stderr)
sys.exit(2)
'''


@pytest.fixture
def made(bench):
    """The workbench with a Makefile whose environment is the one that runs the tests."""
    bench.settings = {}
    shutil.copy(ROOT / "Makefile", bench.folder)
    for name in ("pyproject.toml", "constraints.txt"):
        (bench.folder / name).touch()
        os.utime(bench.folder / name, (0, 0))
    (bench.folder / ".venv").mkdir()
    (bench.folder / ".venv" / "bin").symlink_to(Path(sys.executable).parent)
    (bench.folder / ".venv" / ".flowslide-installed").touch()
    return bench


def start(bench, **options) -> subprocess.Popen[str]:
    ours = {
        name: text for name, text in os.environ.items() if not name.startswith(("MAKE", "MFLAGS"))
    }
    environment = {**ours, "PYTHONPATH": str(ROOT)}
    return subprocess.Popen(
        ["make", "lsfd"], cwd=bench.folder, env=environment, stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, **options,
    )  # fmt: skip


def ended(process: subprocess.Popen[str]) -> tuple[int, list[str]]:
    said, _ = process.communicate(timeout=120)
    return process.returncode, said.splitlines()


def failed(bench) -> str:
    """The last line before make's own, of which each failure has one."""
    code, lines = ended(start(bench))
    assert code == 2 and lines[-1].startswith("make: ***"), lines
    errors = [line for line in lines if line.startswith("error: ")]
    assert errors == lines[-2:-1] and "Traceback" not in "\n".join(lines), lines
    return errors[0]


def until(true, what: str) -> None:
    for _ in range(1200):
        if true():
            return
        time.sleep(0.05)
    raise AssertionError(f"not after a minute: {what}")


def lives(process: int) -> bool:
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def test_no_such_case(made):
    shutil.rmtree(made.folder / "case_histories" / "lower_san_fernando")
    assert failed(made) == (
        "error: answer_lsfd: no such target; `snakemake --list-target-rules` lists them"
    )


def test_a_bad_setting(made):
    config = made.folder / "config" / "config.yaml"
    config.write_text(config.read_text() + "bogus: 1\n")
    assert failed(made).startswith("error: configuration: bogus: no such setting; allowed are ")


def test_results_that_cannot_be_written(made):
    (made.folder / "results").write_text("a file")
    assert failed(made) == "error: results_folder: results: no files can be written in results"


def test_a_job_that_refuses_its_case(made):
    made.stand_in("inversion").write_text(FAILING)
    line = failed(made)
    assert "scene.yaml: spacing: -1: more than 0 (log: results/logs/classical_" in line


def test_a_job_that_is_killed_without_a_word(made):
    program = "import os, signal\nos.kill(os.getpid(), signal.SIGKILL)\n"
    made.stand_in("inversion").write_text(program)
    assert "it was ended and said nothing (log: results/logs/classical_" in failed(made)


def test_another_workflow_at_work(made):
    locks = made.folder / ".snakemake" / "locks"
    locks.mkdir(parents=True)
    (locks / "0.output.lock").write_text("results/lower_san_fernando/inversion/result.json\n")
    alive = made.folder / ".snakemake" / "alive"
    alive.mkdir()
    with (alive / "elsewhere-1").open("w") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        assert failed(made).startswith("error: another workflow works in this folder: wait")


def test_progress_is_in_a_log_while_the_work_goes_on(made):
    made.stand_in("inversion").write_text(SLOW)
    process = start(made)
    seen = []
    for line in process.stdout:
        seen.append(line.rstrip("\n"))
        if seen[-1] == WORKING:
            (made.folder / "go").touch()
    assert process.wait(timeout=60) == 0
    process.stdout.close()
    assert seen[0].startswith("Back-analysis of the Lower San Fernando dam")
    assert WORKING in seen and "S_r 26 kPa" in seen
    assert seen.index("Back-analysis of the case history lower_san_fernando") < seen.index(WORKING)


def test_what_is_killed_takes_its_jobs_with_it_and_is_gone_on_with(made):
    made.stand_in("inversion").write_text(SLOW)
    process = start(made, start_new_session=True)
    until((made.folder / "started").exists, "the job works")
    job = int((made.folder / "started").read_text() or 0)
    (snakemake,) = (
        int(path.parent.name)
        for path in Path("/proc").glob("[0-9]*/cmdline")
        if b"answer_lsfd" in path.read_bytes() and os.getpgid(int(path.parent.name)) == process.pid
        and b"snakemake\0" in path.read_bytes()
    )  # fmt: skip
    os.kill(snakemake, signal.SIGKILL)
    ended(process)
    until(lambda: not lives(job), "the job has ended with its workflow")
    assert list((made.folder / ".snakemake" / "locks").glob("*.lock")), "a lock was left"

    (made.folder / "go").touch()
    code, lines = ended(start(made))
    assert code == 0 and "S_r 26 kPa" in lines
    assert "An earlier workflow in this folder was killed; going on where it was." in lines
