"""Tables of a relation over several slides."""

from __future__ import annotations

import math

from inversion.joint.document import JointDocument, JointRelation, SlideRow
from report.numbers import number, percent
from report.table import Table

KINDS = {"slide": "ran", "bound": "stood", "undetermined": "not determined", "recalled": "recalled"}


def slide_table(document: JointDocument) -> Table:
    """What each slide says."""
    rows = [
        [
            one.title,
            KINDS[one.kind] + ", from numbers" * (not one.drawn),
            _ratio(one) if one.tells else None,
            _range(one.ratio_95) if one.kind == "slide" else None,
            one.verdict.replace("_", " ") or "none made",
            f"{one.factor:.2f}",
            f"{one.formal_log_std:.2f}",
            f"{one.log_std:.2f}",
            None if one.weight == 1.0 else number(one.weight),
            None if one.n1_60 is None else f"{one.n1_60:.1f}{' (recalled)' * one.n1_60_recalled}",
            None if one.after is None else _range(one.after.interval_95),
        ]
        for one in document.slides
    ]
    header = [
        "slide",
        "it",
        "S_r/σ'_v0",
        "95 %",
        "verdict",
        "factor of nine of ten",
        "std of ln, own",
        "as it enters",
        "weight",
        "N1,60",
        "95 % with the others",
    ]
    return Table(header, rows)


def relation_table(document: JointDocument) -> Table:
    """The relation before and after, and by other readings."""
    rows = [_row(one) for one in (document.before, document.relation, *document.readings)]
    header = ["relation", "slides", "median", "95 %", "scatter, a factor", "95 % of it", "ln Z"]
    return Table(header, rows)


def left_out_table(document: JointDocument) -> Table:
    """Each slide as the others predict it."""
    rows = [
        [one.title, f"{one.predicted_median:.3f}", _range(one.predicted_95), percent(one.chance)]
        for one in document.left_out
    ]
    return Table(["left out", "predicted", "95 %", "chance"], rows)


def explanation_table(document: JointDocument) -> Table:
    """Ways in which slides and bounds agree."""
    rows = [
        [one.words, f"{one.log_evidence:.2f}", percent(one.probability)]
        for one in document.explanations
    ]
    return Table(["explanation", "ln Z", "probability"], rows)


def published_table(document: JointDocument) -> Table:
    """Published relations at each slide."""
    titles = {row.case: row.title for row in document.slides}
    rows = [
        [
            titles[one.case],
            one.label,
            f"{one.ratio:.3f}",
            ", ".join(["beyond its data"] * one.beyond + ["blow count recalled"] * one.recalled),
        ]
        for one in document.published
    ]
    return Table(["slide", "published relation", "S_r/σ'_v0", "remark"], rows)


def author_table(document: JointDocument) -> Table:
    """Strengths that others found."""
    titles = {row.case: row.title for row in document.slides}
    rows = [
        [
            titles[one.case],
            f"{one.source}{f', {one.part}' if one.part else ''}",
            f"{one.ratio:.3f}",
            "theirs" if one.own_stress else "ours",
            "recalled, unverified" if one.recalled else "",
        ]
        for one in document.authors
    ]
    return Table(["slide", "by", "S_r/σ'_v0", "stress", "remark"], rows)


def _ratio(one: SlideRow) -> str:
    if one.kind == "bound":
        return f"at least {one.ratio_95[0]:.3f} (95 %)"
    return f"{one.ratio:.3f}"


def _row(one: JointRelation) -> list[str]:
    low, high = (math.exp(end) for end in one.scatter.interval_95)
    return [
        one.name,
        str(one.slides),
        f"{one.median.median:.3f}",
        _range(one.median.interval_95),
        f"{math.exp(one.scatter.median):.2f}",
        f"{low:.2f} to {high:.2f}",
        f"{one.log_evidence:.2f}",
    ]


def _range(interval: tuple[float, float]) -> str:
    return f"{interval[0]:.3f} to {interval[1]:.3f}"
