"""Memory of this process, without torch or Taichi."""

from __future__ import annotations

import re
from pathlib import Path


def highest_resident() -> float:
    """Highest resident size of this process so far [GiB]; unlike getrusage's, not its parent's."""
    status = Path("/proc/self/status").read_text(encoding="ascii")
    return int(re.search(r"VmHWM:\s*(\d+) kB", status)[1]) / 2**20
