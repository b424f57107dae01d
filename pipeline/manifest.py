"""How a result was made: settings, code, seeds, package versions, machine, time."""

from __future__ import annotations

import os
import platform
import re
import subprocess
from collections.abc import Mapping
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from typing import Any

from pydantic import BaseModel

import pipeline
from pipeline.config import config_hash

DISTRIBUTION = "flowslide"


def manifest(config: BaseModel, seeds: Mapping[str, int]) -> dict[str, Any]:
    """Everything needed to say where a result came from, as plain JSON values.

    Args:
        config: the settings that were used.
        seeds: every seed that was used, by the name of what it decided.
    """
    return {
        "config_hash": config_hash(config),
        "config": config.model_dump(mode="json"),
        "seeds": dict(seeds),
        "code_version": code_version(),
        "packages": package_versions(),
        "machine": machine(),
        "made": datetime.now(UTC).isoformat(timespec="seconds"),
    }


def code_version() -> str:
    """Version of flowslide, with the git commit and "+changes" where the checkout has them."""
    commit = _git("rev-parse", "--short=12", "HEAD")
    if not commit:
        return pipeline.__version__
    changed = _git("status", "--porcelain", "--untracked-files=no")
    return f"{pipeline.__version__} ({commit}{'+changes' if changed else ''})"


def package_versions() -> dict[str, str]:
    """Installed versions of Python and of the packages that flowslide requires."""
    versions = {"python": platform.python_version()}
    try:
        requirements = metadata.requires(DISTRIBUTION) or []
    except metadata.PackageNotFoundError:
        requirements = []
    for requirement in requirements:
        name = re.split(r"[^A-Za-z0-9._-]", requirement, maxsplit=1)[0]
        try:
            versions[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue  # an extra that is not installed here
    return dict(sorted(versions.items()))


def machine() -> dict[str, str | int]:
    """The machine in words: system, processor, number of cores this process may use."""
    return {
        "system": platform.platform(),
        "processor": _processor_name(),
        "cores": len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else 1,
    }


def _processor_name() -> str:
    try:
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()


def _git(*arguments: str) -> str:
    """Output of a git command in the checkout of the sources; "" outside of one."""
    folder = Path(__file__).resolve().parent.parent
    if not (folder / ".git").exists():
        return ""  # an installed copy may lie inside some other repository
    try:
        done = subprocess.run(
            ["git", "-C", str(folder), *arguments],
            capture_output=True,
            text=True,
            timeout=10,
            stdin=subprocess.DEVNULL,
        )
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""
