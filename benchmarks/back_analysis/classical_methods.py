"""Classical methods on the same section.

Kinetics, ZIF and IMM on the section of Lower San Fernando by `python -m inversion classical`,
each with the range over its judgement calls, compared with figures found independently beforehand
on the same section (buoyant, 53 m) and published ones. The differences are explained in
docs/method/classical.md: the section after the slide is constructed.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

from benchmarks.back_analysis import lab
from benchmarks.back_analysis.figures import Figure
from pipeline.files import read_json

TITLE = "Classical methods on the same section"

#: Found beforehand on this section, kPa.
BEFORE = {"kinetics": "24.7", "zif": "17.0 (18.8 to 15.3 at f 0.40 to 0.50)", "imm": "18.2"}
PUBLISHED = {"kinetics": "Olson and Stark 18.7 (15.8-21.8)", "imm": "Weber 25.8 (recalled)"}


def run(folder: Path | None, *, quick: bool) -> list[Figure]:
    """Run the command, read what it left."""
    found = []
    for name, words in ((lab.LSFD, "Lower San Fernando"), (lab.LA_MARQUESA, "La Marquesa")):
        out = lab.FOLDER / "classical" / name
        subprocess.run(
            [sys.executable, "-m", "inversion", "classical", str(lab.CASES / name), "--out",
             str(out)],
            cwd=lab.ROOT, check=True, stdout=subprocess.DEVNULL, stdin=subprocess.DEVNULL,
        )  # fmt: skip
        document = read_json(out / "classical.json")
        for analysis in document["analyses"]:
            before = BEFORE if name == lab.LSFD else {}
            where = words if name == lab.LSFD else f"{words} ({analysis['name']})"
            found += [figure(where, method, before) for method in analysis["methods"]]
        found += [Figure(f"{words}: not analysed", "", note=str(why))
                  for why in document["not_analysed"]]  # fmt: skip
    return found


def figure(where: str, method: dict[str, Any], before: dict[str, str]) -> Figure:
    """One method."""
    key, value = method["method"], method["value_kpa"]
    low, high = method["low_kpa"], method["high_kpa"]
    asked = [before[key]] if key in before else []
    asked += [PUBLISHED[key]] if key in PUBLISHED and before else []
    span = "" if low is None else f" ({low:.1f} to {high:.1f})"
    return Figure(
        f"{where}: {method['title']}",
        "none" if value is None else f"{value:.1f}{span} kPa",
        "; ".join(asked),
        note=method["reason"] or "",
    )
