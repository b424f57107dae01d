"""Classical methods on the same section.

Kinetics, ZIF and IMM by `flowslide classical`, each with the range over its judgement calls,
compared with figures found independently beforehand on the same section (buoyant, 53 m) and
published ones; the section after the slide is constructed ([why they
differ](../method/classical.md#lower-san-fernando)).
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

from benchmarks.back_analysis import lab
from benchmarks.back_analysis.figures import Figure
from pipeline.files import read_json, write_text

TITLE = "Classical methods on the same section"

CASES = {lab.PAPER: "Lower San Fernando, the paper's section", lab.LSFD: "Lower San Fernando",
         lab.LA_MARQUESA: "La Marquesa"}  # fmt: skip
#: Level of the pool in the section of the paper [m].
POOL_M = 35.9
#: Found beforehand on the section of the paper, kPa.
BEFORE = {"kinetics": "24.7", "zif": "17.0 (18.8 to 15.3 at f 0.40 to 0.50)", "imm": "18.2"}
PUBLISHED = {"kinetics": "Olson and Stark 18.7 (15.8-21.8)", "imm": "Weber 25.8 (recalled)"}


def run(folder: Path | None, *, quick: bool) -> list[Figure]:
    """Run the command, read what it left."""
    found = []
    for name, words in CASES.items():
        case = with_pool(lab.CASES / name) if name == lab.PAPER else lab.CASES / name
        out = lab.FOLDER / "classical" / name
        subprocess.run(
            [sys.executable, "-m", "flowslide", "classical", str(case), "--out",
             str(out)],
            cwd=lab.ROOT, check=True, stdout=subprocess.DEVNULL, stdin=subprocess.DEVNULL,
        )  # fmt: skip
        document = read_json(out / "classical.json")
        for analysis in document["analyses"]:
            before = BEFORE if name == lab.PAPER else {}
            where = f"{words} ({analysis['name']})" if name == lab.LA_MARQUESA else words
            found += [figure(where, method, before) for method in analysis["methods"]]
        found += [Figure(f"{words}: not analysed", "", note=str(why))
                  for why in document["not_analysed"]]  # fmt: skip
    return found


def with_pool(folder: Path) -> Path:
    """A copy of the case of the paper with the pool that its section has and its scene leaves out.

    `classical.yaml` reads it as level water in the whole mass.
    """
    copy = lab.FOLDER / "classical" / "cases" / folder.name
    shutil.rmtree(copy, ignore_errors=True)
    shutil.copytree(folder, copy)
    scene = copy / "scene.yaml"
    text = scene.read_text(encoding="utf-8")
    write_text(scene, text.replace("water_level: null", f"water_level: {POOL_M}"))
    return copy


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
