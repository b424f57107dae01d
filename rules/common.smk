# What all rules share: the checked settings, the names of files, the versions of the physics.
#
# When is something made again? Where an input is newer, where the list of inputs has changed, or
# where a value in `params:` has (rerun-triggers in the profiles). Programs are called through
# `shell:`, so an edit to their code makes nothing again: a better docstring must not cost 2,500
# simulations. Where an edit changes results, its author raises PHYSICS_VERSION in the package's
# __init__.py; that number is among the params, in addition to every setting that matters to the rule.

import ast
import fcntl
import os
import socket
import sys
from pathlib import Path

import yaml

from pipeline.cli import InputError
from pipeline.config import Config, validate_settings
from pipeline.files import content_hash, read_json, read_yaml, write_text, yaml_text
from snakemake.exceptions import WorkflowError

# Bars of the programs appear on the terminal from which the workflow was started, although the rules
# send their standard error into files (pipeline.progress).
if sys.stderr.isatty():
    try:
        os.environ.setdefault("FLOWSLIDE_TERMINAL", f"{socket.gethostname()}:{os.ttyname(2)}")
    except OSError:
        pass

# `python` in a shell command is the Python that runs Snakemake.
os.environ["PATH"] = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])


def checked_settings():
    try:
        for path in map(Path, workflow.configfiles):
            # Of a group that is given twice Snakemake takes the last and says nothing.
            read_json(path) if path.suffix == ".json" else read_yaml(path)
        return validate_settings(Config, config, origin="configuration")
    except InputError as error:
        raise WorkflowError(str(error)) from None


def begin_in_folder():
    """Hold a lock for as long as this workflow lives, and clear what a killed one has left.

    Snakemake's own lock outlives a killed Snakemake; these locks do not. Jobs on this machine wait
    for theirs, and end when they get it (`pipeline.cli`).
    """
    alive = Path(".snakemake/alive")
    alive.mkdir(parents=True, exist_ok=True)
    left = list(Path(".snakemake/locks").glob("*.lock"))
    others = [path for path in alive.iterdir() if lives(path, doubtful=bool(left))]
    left = [] if others else left
    for lock in left:
        lock.unlink(missing_ok=True)
    if left:
        logger.warning("An earlier workflow in this folder was killed; going on where it was.")
    place = (alive / f"{socket.gethostname()}-{os.getpid()}").absolute()
    while True:
        own = open(place, "w")
        fcntl.flock(own, fcntl.LOCK_EX)
        if place.exists():  # not tidied away by one that started at the same moment
            os.environ["FLOWSLIDE_WORKFLOW"] = f"{socket.gethostname()}:{place}"
            return own


def lives(path, doubtful):
    """A workflow still holds this lock; the lock of one that has ended is tidied away.

    Not every file system knows of locks on another machine: there a doubtful one is taken to live.
    """
    if doubtful and not path.name.startswith(f"{socket.gethostname()}-"):
        return True
    with open(path) as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except OSError:
            return True
    path.unlink(missing_ok=True)
    return False


def checked_results():
    """The folder of the results, which is a folder or can be made one."""
    place = Path(SETTINGS.results_folder)
    there = next(path for path in (place, *place.parents) if path.exists())
    if not there.is_dir() or not os.access(there, os.W_OK):
        raise WorkflowError(f"results_folder: {place}: no files can be written in {there}")
    return SETTINGS.results_folder


def write_settings():
    """Put the settings in force into one file for the programs, once the workflow has its lock."""
    text = "# Written by the workflow: the settings in force. Edit config/config.yaml instead.\n"
    text += yaml_text(SETTINGS.model_dump(mode="json"))
    path = Path(CONFIG_FILE)
    if not path.exists() or path.read_text(encoding="utf-8") != text:
        write_text(path, text)


def physics_version(package):
    """PHYSICS_VERSION of one of our packages, read without importing it."""
    path = Path(workflow.basedir) / package / "__init__.py"
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        targets = getattr(node, "targets", [getattr(node, "target", None)])
        if any(
            isinstance(target, ast.Name) and target.id == "PHYSICS_VERSION" for target in targets
        ):
            return ast.literal_eval(node.value)
    raise WorkflowError(f"{path}: PHYSICS_VERSION is missing")


SETTINGS = checked_settings()
RESULTS = checked_results()
CONFIG_FILE = str(Path(RESULTS) / "config.yaml")


# Jobs of a cluster read this file as well, and a dry run works on nothing.
if workflow.is_main_process and not workflow.dryrun:
    HELD = begin_in_folder()


# Not while this file is read: a dry run next to a running workflow must not change its settings.
onstart:
    try:
        write_settings()
    except InputError as error:
        raise WorkflowError(str(error)) from None


PHYSICS = {package: physics_version(package) for package in ("geometry", "mpm_taichi")}
# Sections of case histories may have effects on; random scenes never have.
CASE_PHYSICS = {**PHYSICS, "effects": physics_version("mpm_taichi/effects")}
INVERSION_PHYSICS = {**CASE_PHYSICS, "inversion": physics_version("inversion")}
DIAGNOSIS_PHYSICS = {**INVERSION_PHYSICS, "diagnosis": physics_version("diagnosis")}
GNS_PHYSICS = {**PHYSICS, "gns": physics_version("gns")}

CASE_FOLDER = Path(workflow.basedir) / "case_histories"
CASES = sorted(path.parent.name for path in CASE_FOLDER.glob("*/scene.yaml"))
QUESTIONS = [case for case in CASES if (CASE_FOLDER / case / "inversion.yaml").is_file()]
# Known by a few numbers: a family of sections, whose answer is its posterior.
FAMILIES = [case for case in QUESTIONS if (CASE_FOLDER / case / "dimensions.yaml").is_file()]
DRAWN = [case for case in QUESTIONS if case not in FAMILIES]
CASE_ALIASES = {"lsfd": "lower_san_fernando"}

if clash := set(SETTINGS.scales) & {*CASES, *CASE_ALIASES}:
    raise WorkflowError(f"configuration: scales: {', '.join(clash)} is the name of a case history")


# Seconds of work on one core: not worth a place in a cluster's queue.
localrules:
    sample_scenes,
    draw_gallery,
    list_runs,


wildcard_constraints:
    scale="|".join(SETTINGS.scales),
    batch=r"\d\d\d+",
    case="|".join(CASES) or "-",


def gallery(scale):
    return f"{RESULTS}/{scale}/gallery.png"


def statistics(scale):
    return f"{RESULTS}/{scale}/runs.csv"


def dataset(scale):
    return f"{RESULTS}/{scale}/dataset/metadata.json"


def trained(scale):
    return f"{RESULTS}/{scale}/model/trained.txt"


def evaluated(scale):
    return f"{RESULTS}/{scale}/model/card.yaml"


def batch_files(scale, folder, suffix):
    batches = range(SETTINGS.scale(scale).number_of_batches)
    return [f"{RESULTS}/{scale}/{folder}/batch_{batch:03d}.{suffix}" for batch in batches]


def scenes(wildcards):
    return batch_files(wildcards.scale, "scenes", "txt")


def trajectories(wildcards):
    return batch_files(wildcards.scale, "trajectories", "h5")


def batch_indices(wildcards):
    """Numbers of the scenes of a batch, such as 700-799."""
    indices = SETTINGS.scale(wildcards.scale).batch_indices(int(wildcards.batch))
    return f"{indices[0]}-{indices[-1]}"


def simulated_case(case):
    return f"{RESULTS}/{case}/simulation/runout.png"


def inverted_case(case):
    return f"{RESULTS}/{case}/inversion/result.json"


def posterior_of_case(case):
    return f"{RESULTS}/{case}/posterior/posterior.json"


def diagnosed_case(case):
    return f"{RESULTS}/{case}/diagnosis/verdict.json"
