"""Groups of commands, as a test types them: `gns(["pack", ...])` is `flowslide gns pack ...`."""

from __future__ import annotations

from collections.abc import Sequence

from flowslide.command_line import main


def gns(words: Sequence[str]) -> int:
    """`flowslide gns`."""
    return main(["gns", *words])


def diagnose(words: Sequence[str]) -> int:
    """`flowslide diagnose`."""
    return main(["diagnose", *words])
