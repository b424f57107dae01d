"""A copy of the workflow around stand-ins for the programs, which do next to nothing, at once."""

from __future__ import annotations

import json
import os
import re
import select
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).resolve().parents[2]

GEOMETRY = '''
"""Stand-in for geometry: writes its arguments."""
import sys
from pathlib import Path
arguments = dict(zip(sys.argv[2::2], sys.argv[3::2]))
if sys.argv[1] == "sample":
    Path(arguments["--out"]).mkdir(parents=True, exist_ok=True)
    print("sampled", arguments["--scale"], arguments["--indices"])
else:
    Path(arguments["--out"]).write_bytes(b"picture")
'''

MPM_TAICHI = '''
"""Stand-in for mpm_taichi: trajectories are texts; a file `break` makes batch 1 fail."""
import sys
import time
from pathlib import Path
command = sys.argv[1]
if command == "status":
    files, out = sys.argv[2:-2], Path(sys.argv[-1])
    lines = ["file,index,scene,template,seed,points,frames,steps,duration_s,wall_time_s,"
             "point_steps_per_s,status,reason,wall_contact,travel_left_m,travel_right_m"]
    for number, file in enumerate(files):
        bad = "failed,energy out of balance," if number == 1 else "finished,,right"
        lines.append(f"{file},{number},s_{number},a,7,100,5,50,4.5,0.1,5e4,{bad},1.5,12.5")
    out.write_text("\\n".join(lines) + "\\n")
    sys.exit()
options = sys.argv[2:] if command == "run" else sys.argv[3:]
arguments = dict(zip(options[::2], options[1::2]))
out = Path(arguments["--out"])
out.mkdir(parents=True, exist_ok=True)
if command == "run":
    batch = int(arguments["--batch"])
    file = out / f"batch_{batch:03d}.h5"
    if batch == 1 and Path("break").exists():
        (out / ".batch_001.parts").mkdir(exist_ok=True)
        (out / ".batch_001.parts" / "run").touch()
        sys.exit(1)
    file.write_text(f"{arguments['--device']} {time.time()}")
else:
    for name in ("runout.png", "runout.mp4", "observables.csv"):
        (out / name).write_text(sys.argv[2])
    print("toe_runout 53 m")
'''

GNS = '''
"""Stand-in for gns: lists the files to pack; models are texts."""
import sys
from pathlib import Path
place = sys.argv.index("--scale")
files, options = sys.argv[2:place], [word for word in sys.argv[place:] if word != "--start-over"]
arguments = dict(zip(options[::2], options[1::2]))
if sys.argv[1] == "evaluate":
    model = Path(arguments["--model"])
    for name in ("card.yaml", "evaluation.csv", "worst.png", "training.png"):
        (model / name).write_text(str(Path(arguments["--mpm"]).stat().st_size))
    print("runout 1.5 spacings")
    sys.exit()
out = Path(arguments["--out"])
out.mkdir(parents=True, exist_ok=True)
if sys.argv[1] == "train":
    if Path("break").exists():
        (out / "state").mkdir(exist_ok=True)
        (out / "state" / "last.pt").touch()
        sys.exit(1)
    (out / "model.pt").write_text(arguments["--device"])
    print("trained", arguments["--data"])
    sys.exit()
left_out = Path(arguments["--leave-out"]).read_text()
(out / "metadata.json").write_text(f"{arguments['--scale']} {len(files)} files\\n{left_out}")
'''

INVERSION = '''
"""Stand-in for inversion: writes its arguments."""
import sys
from pathlib import Path
command, case = sys.argv[1:3]
arguments = dict(zip(sys.argv[3::2], sys.argv[4::2]))
out = Path(arguments["--out"])
out.mkdir(parents=True, exist_ok=True)
if command == "classical":
    (out / "classical.json").write_text("{}")
else:
    for name in ("result.json", "history.csv", "sections.npz", "run.h5", "report.html"):
        (out / name).write_text(case)
    print("S_r 26 kPa")
'''

FLOWSLIDE = """
'Stand-in for flowslide: the stand-in of the package whose command it is.'
import runpy
import sys
DOORS = {
    ("scenes", "sample"): ("geometry", "sample"), ("show",): ("geometry", "show"),
    ("scenes", "simulate"): ("mpm_taichi", "run"), ("simulate",): ("mpm_taichi", "case"),
    ("runs", "status"): ("mpm_taichi", "status"), ("gns",): ("gns",),
    ("classical",): ("inversion", "classical"), ("invert",): ("inversion", "invert"),
    ("posterior",): ("inversion", "posterior"), ("diagnose",): ("diagnosis",),
}
words = sys.argv[1:]
typed = next(one for one in DOORS if tuple(words[: len(one)]) == one)
package, *command = DOORS[typed]
sys.argv = [package, *command, *words[len(typed) :]]
runpy.run_path(f"{package}/commands.py", run_name="__main__")
"""

# Rules that only collect what others make.
COLLECTING = (
    r"everything$|all$|(geometry|simulate|pack|train|evaluate|invert|diagnose)_"
    r"(?!batch|case|trajectories|model)"
)


DIAGNOSIS = '''
"""Stand-in for diagnosis: writes its arguments."""
import sys
from pathlib import Path
command, case = sys.argv[1:3]
arguments = dict(zip(sys.argv[3::2], sys.argv[4::2]))
out = Path(arguments["--out"])
out.mkdir(parents=True, exist_ok=True)
for name in ("verdict.json", "sections.npz", "report.html"):
    (out / name).write_text(f"{command} {case}")
print("identified")
'''


SERVER = '''
"""Reads requests, runs `python -m snakemake` for each in a fork of itself, writes exit codes."""
import json
import os
import sys
from snakemake.cli import main
for line in sys.stdin:
    request = json.loads(line)
    child = os.fork()
    if child == 0:
        os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
        out = os.open(request["output"], os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(out, 1)
        os.dup2(out, 2)
        os.chdir(request["folder"])
        sys.path[0] = request["folder"]
        sys.argv = ["snakemake", *request["words"]]
        main()
        sys.exit()
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
'''


class Snakemake:
    """Snakemake, whose import takes longer than what it does here: it is imported once."""

    def __init__(self, folder: Path) -> None:
        self.output = folder / "output.txt"
        self.server = subprocess.Popen(
            [sys.executable, "-c", SERVER],
            env={**os.environ, "COLUMNS": "200"},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def run(self, words: Sequence[str], folder: Path) -> tuple[int, str]:
        """The exit code and all that was said."""
        request = {"words": words, "folder": str(folder), "output": str(self.output)}
        self.server.stdin.write(json.dumps(request) + "\n")
        self.server.stdin.flush()
        assert select.select([self.server.stdout], [], [], 120.0)[0], "no end after 120 s"
        code = int(self.server.stdout.readline())
        return code, self.output.read_text()

    def close(self) -> None:
        """End it, with what it runs."""
        self.server.stdin.close()
        self.server.terminate()
        self.server.wait()
        self.server.stdout.close()


class Workbench:
    """The folder with the copy, and Snakemake in it."""

    def __init__(self, folder: Path, program: Snakemake) -> None:
        self.folder = folder
        self.program = program
        for name in ("Snakefile", "rules", "profiles", "config", "report"):
            source = ROOT / name
            if source.is_dir():
                shutil.copytree(source, folder / name, symlinks=True)
            else:
                shutil.copy(source, folder / name)
        programs = {
            "geometry": GEOMETRY,
            "mpm_taichi": MPM_TAICHI,
            "gns": GNS,
            "inversion": INVERSION,
            "diagnosis": DIAGNOSIS,
        }
        (folder / "flowslide").mkdir()
        (folder / "flowslide" / "__init__.py").touch()
        (folder / "flowslide" / "__main__.py").write_text(FLOWSLIDE)
        for package, program in programs.items():
            (folder / package).mkdir()
            self.stand_in(package).write_text(program)
            self.set_physics(package, 1)
        (folder / "mpm_taichi" / "effects").mkdir()
        self.set_physics("mpm_taichi/effects", 1)
        case = folder / "case_histories" / "lower_san_fernando"
        case.mkdir(parents=True)
        (case / "scene.yaml").write_text("name: stand-in\n")
        (case / "README.md").write_text("text\n")
        (case / "inversion.yaml").write_text("parameters: []\n")
        (case / "measurements.yaml").write_text("sets: {field: [{type: surface_profile}]}\n")
        self.settings = yaml.safe_load((ROOT / "config" / "test.yaml").read_text())
        self.settings["results_folder"] = "results"

    def stand_in(self, package: str) -> Path:
        """What stands in for the commands of a package."""
        return self.folder / package / "commands.py"

    def set_physics(self, package: str, version: int, docstring: str = "") -> None:
        path = self.folder / package / "__init__.py"
        path.write_text(f'"""Stand-in. {docstring}"""\nPHYSICS_VERSION = {version}\n')

    def snakemake(self, *targets: str, options: Sequence[str] = (), expect: int = 0) -> str:
        """Run Snakemake; return all it said."""
        (self.folder / "my.yaml").write_text(yaml.safe_dump(self.settings))
        words = [*options, "--configfile", "my.yaml", "--", *targets]
        code, said = self.program.run(words, self.folder)
        assert code == expect, said
        return said

    def planned(self, *targets: str) -> dict[str, int]:
        """Jobs by rule that Snakemake would run now; the collecting targets are left out."""
        text = self.snakemake(*targets, options=["--dry-run"])
        table = re.search(r"^job +count\n-+ +-+\n(.*?)\ntotal ", text, re.MULTILINE | re.DOTALL)
        if table is None:
            assert "Nothing to be done" in text
            return {}
        jobs = dict(line.split() for line in table[1].splitlines())
        return {name: int(count) for name, count in jobs.items() if not re.match(COLLECTING, name)}

    def path(self, name: str) -> Path:
        return self.folder / "results" / name


@pytest.fixture(scope="session")
def program(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Snakemake]:
    started = Snakemake(tmp_path_factory.mktemp("snakemake"))
    yield started
    started.close()


@pytest.fixture
def bench(tmp_path: Path, program: Snakemake) -> Workbench:
    return Workbench(tmp_path, program)
