"""One dam, two questions: the strengths of the back-analysis and of the diagnosis, side by side.

The back-analysis asks which strength brings the slide to where its toe was measured, whatever else
the model gets wrong. The diagnosis asks which strength agrees best with all measurements together,
with the model's own error in their covariance. Where the model can explain every measurement the
two agree; where it cannot, they differ, and a reader of either report must see both and why.

In: the folder of one of the results, `results/<case>/inversion` or `results/<case>/diagnosis`; the
other is looked for next to it. Out: a table and a paragraph, empty where there is only one.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from diagnosis.verdict.verdict import (
    COMPARE_FILE,
    FILE_NAME,
    CompareDocument,
    FittedModelSummary,
    Verdict,
)
from inversion.back_analysis.result import FILE_NAME as RESULT_FILE
from inversion.back_analysis.result import FittedTo, Result, load_result
from inversion.engines.registry import engine_named, engines
from pipeline.cli import InputError
from pipeline.config import validate_settings
from pipeline.files import read_json
from pipeline.ties import largest
from report.numbers import plus_minus
from report.page import Part, said, tabulated
from report.table import Table, plain

DIAGNOSIS = "diagnosis"
TITLE = "Two questions, two strengths"
HEAD = ("", "strength", "the question")
#: Two strengths agree within this many standard deviations of their difference.
AGREE = 2.0
#: The base model fails where chi2 is larger than noise would leave by this factor.
FAILS = 2.0


@dataclass(frozen=True)
class TwoStrengths:
    """The strengths of one case by the two questions.

    Attributes:
        table: who answers, the strength with its standard deviation, the question.
        reason: why there are two, and what their difference says.
    """

    table: Table
    reason: str = ""

    def text(self) -> str:
        """For a terminal; empty where only one of the two questions was asked."""
        return f"{self.table.text(folded=True)}\n{plain(self.reason)}" if self.reason else ""

    def parts(self) -> list[Part]:
        """For a page; empty where only one of the two questions was asked."""
        return [*tabulated(self.table), *said([self.reason])]


def two_strengths(folder: str | Path) -> TwoStrengths:
    """The strengths of a case by the two questions; empty: only one of the two was asked.

    Args:
        folder: of a back-analysis or of a diagnosis.
    """
    folder = Path(folder).resolve()
    answer, document = _back_analysis(folder), diagnosis_in(folder.parent)
    if answer is None or document is None or answer.case != document.case:
        return TwoStrengths(Table(HEAD, []))
    words = {p.name: p for p in document.parameters if p.strength}
    said = engine_named(answer.engine).said
    by = f" {said}" if said else ""
    shared = [p for p in answer.answer.parameters if p.name in words and p.lower_bound_95 is None]
    rows, differences = [], []
    for parameter in shared:
        name, unit = parameter.name, parameter.unit
        of = f", {parameter.label}" if len(shared) > 1 else ""
        base = document.base
        value = plus_minus(parameter.value, parameter.std_total, unit)
        rows.append((f"back-analysis{by}{of}", value, _question(answer.answer.fitted_to)))
        rows.append(_of_stage(f"diagnosis, base model{of}", base, name, unit, document))
        final = document.final if isinstance(document, Verdict) else base
        if final.effects:
            with_effects = f"diagnosis, with {', '.join(final.effects)}{of}"
            rows.append(_of_stage(with_effects, final, name, unit, document))
        apart = abs(parameter.value - base.values[name])
        width = (parameter.std_total**2 + base.std[name] ** 2) ** 0.5
        differences.append((apart, apart / max(width, 1e-12), unit))
    reason = _reason(differences, document.base) if rows else ""
    return TwoStrengths(Table(HEAD, rows, TITLE), reason)


def _of_stage(
    who: str, stage: FittedModelSummary, name: str, unit: str, document: Verdict | CompareDocument
) -> tuple[str, str, str]:
    value = plus_minus(stage.values[name], stage.std[name], unit)
    return who, value, _question(document.fitted_to)


def _question(fitted_to: FittedTo | None) -> str:
    return "not recorded by this version" if fitted_to is None else fitted_to.words


def _reason(differences: list[tuple[float, float, str]], base: FittedModelSummary) -> str:
    questions = (
        "The back-analysis asks which strength brings what it fits to where it was measured, "
        "whatever else the model gets wrong; the diagnosis asks which strength agrees best with "
        "all its measurements together, the model's own error included."
    )
    apart, in_std, unit = largest(differences, lambda difference: difference[1])
    if in_std <= AGREE:
        return f"{questions} Here the two agree within {AGREE:g} standard deviations."
    noise = f"chi2 is {base.chi2:.0f} where noise would leave {base.dof}"
    if base.chi2 > FAILS * base.dof:
        why = (
            f"No strength makes this model explain all measurements at once ({noise}): the "
            "diagnosis' value is the best compromise of a model that fails, not an estimate."
        )
    else:
        why = (
            f"The model explains all measurements together ({noise}), with another strength than "
            "the back-analysis' data alone ask for."
        )
    differ = f"Here they differ by {apart:.1f} {unit}, {in_std:.1f} standard deviations."
    return f"{questions} {differ} {why}"


def _back_analysis(folder: Path) -> Result | None:
    """That of the folder, else one next to it, by the material point method first.

    None: there is none, or none that can be read.
    """
    for place in (folder, *(folder.parent / engine.folder for engine in engines().values())):
        if (place / RESULT_FILE).is_file():
            try:
                return load_result(place)
            except InputError:
                continue
    return None


def diagnosis_in(results: Path) -> Verdict | CompareDocument | None:
    """The verdict of a case, or where there is none the comparison; None: neither is readable."""
    for name, kind in ((FILE_NAME, Verdict), (COMPARE_FILE, CompareDocument)):
        path = results / DIAGNOSIS / name
        if path.is_file():
            try:
                return validate_settings(kind, read_json(path), origin=str(path))
            except InputError:
                continue
    return None
