"""The catalogue of 16 flow slides, the strengths others found, and where our answers belong.

In: `catalogue.csv` and `catalogue_strengths.csv` of `case_histories/`, and `result.json` files.
Out: `Entry`, `Strength` and `OurAnswer` lists for tables and for the figure
(`report.charts.catalogue`). What is only recalled says so.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pipeline.cli import InputError
from pipeline.files import read_json, read_text
from pipeline.places import CASES, shipped

FOLDER = shipped(CASES)
CATALOGUE_FILE, STRENGTHS_FILE = "catalogue.csv", "catalogue_strengths.csv"
CONFIDENCES = ("published", "paper", "recalled")


@dataclass(frozen=True)
class Entry:
    """One flow slide. Lengths in m; `case` is its folder here, empty where it has none."""

    name: str
    case: str
    length_m: float
    height_m: float
    paper_height_m: float
    template: str
    runout_m: float | None
    runout_confidence: str
    note: str


@dataclass(frozen=True)
class Strength:
    """A residual strength found by others. Strengths and stresses in kPa; None: not known."""

    name: str
    part: str
    zones: tuple[str, ...]
    source: str
    s_r_kpa: float
    low_kpa: float | None
    high_kpa: float | None
    sigma_v0_kpa: float | None
    n1_60: float | None
    confidence: str
    soil_confidence: str

    @property
    def ratio(self) -> float | None:
        """S_r/sigma'_v0, where the stress is known."""
        return None if self.sigma_v0_kpa is None else self.s_r_kpa / self.sigma_v0_kpa

    @property
    def ratio_range(self) -> tuple[float, float] | None:
        """The stated range of the strength as ratios, where stress and range are known."""
        if self.sigma_v0_kpa is None or self.low_kpa is None or self.high_kpa is None:
            return None
        return self.low_kpa / self.sigma_v0_kpa, self.high_kpa / self.sigma_v0_kpa

    @property
    def recalled(self) -> bool:
        """True where the strength or the soil is known from memory alone."""
        return "recalled" in (self.confidence, self.soil_confidence)


@dataclass(frozen=True)
class OurAnswer:
    """A strength found by this tool, as the catalogue compares it.

    Attributes:
        case: folder of the case.
        title: of the case, in words.
        label: of the strength, in words.
        zones: of the scene that share it.
        s_r_kpa: the answer [kPa].
        std_kpa: its standard deviation, all sources [kPa].
        ratio: S_r/sigma'_v0 with the stress of our section.
        ratio_std: its standard deviation.
        bound: strength and ratio are lower bounds (95 %): nothing flowed.
    """

    case: str
    title: str
    label: str
    zones: tuple[str, ...]
    s_r_kpa: float
    std_kpa: float
    ratio: float
    ratio_std: float
    bound: bool = False

    @property
    def words(self) -> str:
        """The strength: a value with its standard deviation, or a lower bound."""
        if self.bound:
            return f"at least {self.s_r_kpa:.3g} kPa (95 %)"
        return f"{self.s_r_kpa:.3g} ± {self.std_kpa:.2g} kPa"

    @property
    def ratio_words(self) -> str:
        """The same of the ratio."""
        return (
            f"at least {self.ratio:.3f}"
            if self.bound
            else (f"{self.ratio:.3f} ± {self.ratio_std:.3f}")
        )


def load_catalogue(folder: Path = FOLDER) -> list[Entry]:
    """The 16 cases.

    Raises:
        InputError: no such file, a missing column, or a value that is not what it should be.
    """
    path = folder / CATALOGUE_FILE
    return [
        Entry(
            name=row["name"],
            case=row["case"],
            length_m=number_of(row, "length_m", where),
            height_m=number_of(row, "height_m", where),
            paper_height_m=number_of(row, "paper_height_m", where),
            template=row["template"],
            runout_m=_optional(row, "runout_m", where),
            runout_confidence=row["runout_confidence"],
            note=row["note"],
        )
        for where, row in rows_of(path, Entry.__dataclass_fields__)
    ]


def load_strengths(folder: Path = FOLDER) -> list[Strength]:
    """The strengths others found.

    Raises:
        InputError: as `load_catalogue`; also a case that the catalogue does not have, and a range
            that does not hold its value.
    """
    known = {entry.name for entry in load_catalogue(folder)}
    path = folder / STRENGTHS_FILE
    found = []
    for where, row in rows_of(path, Strength.__dataclass_fields__):
        strength = Strength(
            name=row["name"],
            part=row["part"],
            zones=tuple(row["zones"].split()),
            source=row["source"],
            s_r_kpa=number_of(row, "s_r_kpa", where),
            low_kpa=_optional(row, "low_kpa", where),
            high_kpa=_optional(row, "high_kpa", where),
            sigma_v0_kpa=_optional(row, "sigma_v0_kpa", where),
            n1_60=_optional(row, "n1_60", where),
            confidence=row["confidence"],
            soil_confidence=row["soil_confidence"],
        )
        _check(strength, known, where)
        found.append(strength)
    return found


def answers_of(result: Mapping[str, Any]) -> list[OurAnswer]:
    """The strengths of a `result.json` that have a stress to be compared with."""
    found = []
    for parameter in result["answer"]["parameters"]:
        if parameter["ratio"] is None:
            continue
        bound = parameter.get("ratio_lower_bound_95") is not None
        # Of a strength ratio the mean strength over its zones is compared.
        kpa = 1.0 if parameter.get("strength_kpa") is None else parameter["sigma_v0_kpa"]
        found.append(
            OurAnswer(
                case=result["case"],
                title=result["title"],
                label=parameter["label"],
                zones=tuple(parameter["zones"]),
                s_r_kpa=kpa * parameter["lower_bound_95" if bound else "value"],
                std_kpa=kpa * parameter["std_total"],
                ratio=parameter["ratio_lower_bound_95" if bound else "ratio"],
                ratio_std=parameter["ratio_std"],
                bound=bound,
            )
        )
    return found


def load_answers(paths: Iterable[str | Path]) -> list[OurAnswer]:
    """The strengths of several `result.json` files.

    Raises:
        InputError: no such file, no JSON, or no answer of a back-analysis.
    """
    found = []
    for path in paths:
        result = read_json(path)
        try:
            found += answers_of(result)
        except (KeyError, TypeError):
            raise InputError(
                f"{path}: is not an answer of a back-analysis (flowslide invert writes them)"
            ) from None
    return found


def blow_count(
    answer: OurAnswer, strengths: Sequence[Strength], entries: Sequence[Entry]
) -> Strength | None:
    """The catalogue's row whose blow count belongs to one of our answers; None: none is known."""
    names = {entry.name for entry in entries if entry.case == answer.case}
    for strength in strengths:
        same = strength.name in names and set(strength.zones) & set(answer.zones)
        if same and strength.n1_60 is not None:
            return strength
    return None


def _check(strength: Strength, known: set[str], where: str) -> None:
    if strength.name not in known:
        raise InputError(f"{where}: name: {strength.name!r} is not in {CATALOGUE_FILE}")
    allowed = ("", *CONFIDENCES)
    for field, value in (
        ("confidence", strength.confidence),
        ("soil_confidence", strength.soil_confidence),
    ):
        if value not in allowed or (field == "confidence" and not value):
            raise InputError(f"{where}: {field}: {value!r}; allowed are {', '.join(CONFIDENCES)}")
    low, high = strength.low_kpa, strength.high_kpa
    if (low is None) != (high is None):
        raise InputError(f"{where}: low_kpa, high_kpa: give both or neither")
    if low is not None and high is not None and not low <= strength.s_r_kpa <= high:
        raise InputError(
            f"{where}: s_r_kpa {strength.s_r_kpa:g} lies outside low_kpa {low:g} to "
            f"high_kpa {high:g}"
        )


def rows_of(path: Path, columns: Iterable[str]) -> list[tuple[str, dict[str, str]]]:
    """Rows of a CSV file with comments, each with its place for messages."""
    text = read_text(path).splitlines()
    numbered = [(n, line) for n, line in enumerate(text, 1) if line and not line.startswith("#")]
    reader = csv.DictReader(line for _, line in numbered)
    for column in columns:
        if column not in (reader.fieldnames or []):
            raise InputError(f"{path}: column {column} is missing")
    try:
        rows = list(reader)
    except csv.Error as error:
        raise InputError(f"{path}: is not a table: {error}") from None
    if len(rows) != len(numbered) - 1:
        raise InputError(f"{path}: a quoted text goes over several lines; a row is one line")
    for (n, _), row in zip(numbered[1:], rows, strict=True):
        if None in row:
            raise InputError(f"{path}: line {n}: has more cells than there are columns")
    return [
        (f"{path}: line {n}", {key: (value or "").strip() for key, value in row.items()})
        for (n, _), row in zip(numbered[1:], rows, strict=True)
    ]


def _optional(row: Mapping[str, str], column: str, where: str) -> float | None:
    return number_of(row, column, where) if row[column] else None


def number_of(row: Mapping[str, str], column: str, where: str) -> float:
    """A number greater than 0 of a row; InputError otherwise."""
    try:
        value = float(row[column])
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value > 0.0):
        raise InputError(f"{where}: {column}: {row[column]!r} is not a number greater than 0")
    return value
