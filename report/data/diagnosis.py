"""Data of the report of a diagnosis: a document, and the sections where there are any.

In: a folder with `verdict.json`, `compare.json` or `explain.json`, and perhaps `sections.npz`. Out:
a `DiagnosisData`, which looks the same for all three; what a document lacks is empty, and its part
of the page is left out.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from diagnosis.verdict.sections_file import SlideSurfaces, load_sections
from diagnosis.verdict.verdict import (
    COMPARE_FILE,
    EXPLAIN_FILE,
    FILE_NAME,
    CandidateVerdict,
    CompareDocument,
    Confounding,
    ExplainDocument,
    FittedModelSummary,
    MeasurementVerdict,
    ParameterWords,
    Signatures,
    Verdict,
)
from pipeline.config import validate_settings
from pipeline.files import read_json

Document = Verdict | CompareDocument | ExplainDocument
DOCUMENTS: dict[str, type[Document]] = {
    FILE_NAME: Verdict,
    COMPARE_FILE: CompareDocument,
    EXPLAIN_FILE: ExplainDocument,
}
LEAST_SERIES = 3
"""Least count of numbers along an axis that is drawn as a line."""


@dataclass(frozen=True)
class MeasurementSeries:
    """A measurement of several numbers along the section or in time, in ascending order."""

    name: str
    axis: str
    unit: str
    lines: list[MeasurementVerdict]

    @property
    def places(self) -> list[float]:
        """Where or when, in m or s."""
        return [line.place for line in self.lines]

    @property
    def axis_label(self) -> str:
        """The axis with its unit."""
        return "x (m)" if self.axis == "x_m" else "time (s)"


@dataclass(frozen=True)
class DiagnosisData:
    """Everything that a page shows.

    Attributes:
        folder: page and pictures are written there.
        document: the verdict, or one of the shorter documents before it.
        sections: surfaces of the section; None: unknown.
    """

    folder: Path
    document: Document
    sections: SlideSurfaces | None = None

    @property
    def verdict(self) -> Verdict | None:
        """The document, if it is a complete verdict."""
        return self.document if isinstance(self.document, Verdict) else None

    @property
    def of_body(self) -> bool:
        """The document is of a body in three dimensions."""
        return self.document.manifest.get("settings", {}).get("engine") in ("mpm3d",)

    @property
    def base(self) -> FittedModelSummary:
        """The base model."""
        return self.document.base

    @property
    def final(self) -> FittedModelSummary | None:
        """The model of the answer; None if that is the base model, or there is none yet."""
        if self.verdict is None or not self.verdict.final.effects:
            return None
        return self.verdict.final

    @property
    def measurements(self) -> list[MeasurementVerdict]:
        """All numbers; an explanation has none."""
        return getattr(self.document, "measurements", [])

    @property
    def candidates(self) -> list[CandidateVerdict]:
        """Those that were tested, the best score first."""
        found = getattr(self.document, "candidates", [])
        return [c for c in found if not c.left_out]

    @property
    def left_out(self) -> list[CandidateVerdict]:
        """Candidates that were not tested."""
        return [c for c in getattr(self.document, "candidates", []) if c.left_out]

    @property
    def confounding(self) -> Confounding | None:
        """Which candidates look alike; None: unknown, or there are fewer than two."""
        found = getattr(self.document, "confounding", None)
        return found if found is not None and len(found.names) > 1 else None

    @property
    def signatures(self) -> Signatures | None:
        """Fingerprints; None: there are none."""
        found = getattr(self.document, "signatures", None)
        return found if found is not None and found.entries else None

    @property
    def hidden(self) -> dict[str, dict[str, float]]:
        """Parameter -> effect -> change [%] that the effect can cause undetected."""
        return getattr(self.document, "hidden", {})

    @property
    def stages(self) -> list[tuple[str, FittedModelSummary]]:
        """The base model, and the model of the answer if it is another one."""
        after = [] if self.final is None else [("after", self.final)]
        return [("before" if after else "base model", self.base), *after]

    @property
    def parameters(self) -> list[ParameterWords]:
        """The calibrated parameters; described by name where the document has no words."""
        known = {p.name: p for p in self.document.parameters}
        return [known.get(name) or _unnamed(name, self.base) for name in self.base.values]

    @property
    def series(self) -> list[MeasurementSeries]:
        """Measurements along the section first, then those in time."""
        found: dict[str, list[MeasurementVerdict]] = {}
        for line in self.measurements:
            if line.axis != "none" and line.place is not None:
                found.setdefault(line.measurement, []).append(line)
        made = [
            MeasurementSeries(
                name, lines[0].axis, lines[0].unit, sorted(lines, key=lambda m: m.place)
            )
            for name, lines in found.items()
            if len(lines) >= LEAST_SERIES
        ]
        return sorted(made, key=lambda one: one.axis != "x_m")

    @property
    def singles(self) -> list[MeasurementVerdict]:
        """Numbers that belong to no series."""
        drawn = {line.name for one in self.series for line in one.lines}
        return [line for line in self.measurements if line.name not in drawn]

    @property
    def synthetic(self) -> bool:
        """The measurements come from a simulation, according to the settings."""
        manifest = self.verdict.manifest if self.verdict is not None else {}
        settings = manifest.get("settings", {})
        return bool(manifest.get("synthetic", settings.get("synthetic", False)))


def load_diagnosis(folder: str | Path, name: str = FILE_NAME) -> DiagnosisData:
    """Read a document and the sections next to it.

    Raises:
        InputError: no such file, or one that cannot be read; one line.
    """
    folder = Path(folder)
    path = folder / name
    document = validate_settings(DOCUMENTS[name], read_json(path), origin=str(path))
    return DiagnosisData(folder, document, load_sections(folder))


def _unnamed(name: str, stage: FittedModelSummary) -> ParameterWords:
    low, high = stage.interval_95.get(name, (stage.values[name],) * 2)
    return ParameterWords(
        name=name,
        words=name.replace("_", " "),
        unit="",
        strength="strength" in name,
        low=low,
        high=high,
    )
