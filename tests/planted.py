"""Files in a folder that must not run, wherever a program of ours is started in it."""

from __future__ import annotations

import sys
from pathlib import Path

OURS = ("pipeline", "geometry", "mpm_taichi", "gns", "inversion", "diagnosis", "flowslide")
FOREIGN = ("loky", "numpy", "yaml", "pydantic", "taichi", "torch", "matplotlib", "rich", "shapely")
AT_START = ("sitecustomize", "usercustomize")
PROGRAMS = ("git", "uname", "python", "python3", "chromium", "ffmpeg")


def plant(folder: Path) -> Path:
    """Plant them: modules of every name that Python or a package of ours imports, and programs.

    Returns:
        a file in which each of them writes its name when it runs.
    """
    ran = folder.parent / f"ran_in_{folder.name}.txt"
    for name in (*sys.stdlib_module_names, *OURS, *FOREIGN, *AT_START):
        code = f"with open({str(ran)!r}, 'a') as file: file.write('{name} ')\n"
        (folder / f"{name}.py").write_text(code)
    (folder / "planted.pth").write_text(f"import os; open({str(ran)!r}, 'a').write('pth ')\n")
    script = f"#!/bin/sh\necho program >> '{ran}'\n"
    for name in PROGRAMS:
        (folder / name).write_text(script)
        (folder / name).chmod(0o755)
    (folder / ".git").mkdir()
    (folder / ".git" / "HEAD").write_text("ref: refs/heads/main\n")
    (folder / ".git" / "config").write_text(
        f"[core]\n\trepositoryformatversion = 0\n\tfsmonitor = {folder / 'git'}\n"
    )
    for name in ("objects", "refs"):
        (folder / ".git" / name).mkdir()
    return ran


def planted(folder: Path) -> str:
    """What has run."""
    ran = folder.parent / f"ran_in_{folder.name}.txt"
    return ran.read_text() if ran.exists() else ""


def the_command(place: Path) -> Path:
    """The file that pip makes of `flowslide`, in a folder of programs of its own."""
    program = place / "bin" / "flowslide"
    program.parent.mkdir()
    program.write_text("from flowslide.__main__ import console\nconsole()\n")
    return program
