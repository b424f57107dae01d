"""Cases and their results become slides; slides become `joint.json`."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from geometry.case import Case
from geometry.dimensions.stated import FILE_NAME as DIMENSIONS_FILE
from geometry.dimensions.stated import load_dimensions
from geometry.survey.blow_counts import load_blow_counts
from inversion.catalogue.catalogue import load_catalogue, load_strengths
from inversion.catalogue.correlations import RELATIONS
from inversion.catalogue.ranges import SOURCE, load_ranges
from inversion.joint import infer as joint
from inversion.joint.document import FILE_NAME, Author, JointDocument, Kind, PublishedRatio
from inversion.joint.evidence import BlowCountOfSlide, SlideEvidence, evidence_of
from inversion.joint.population import RATIOS, SLOPE_STD, TAU_STD
from pipeline.cli import InputError
from pipeline.config import Config
from pipeline.files import write_json
from pipeline.manifest import manifest

#: Least standard deviation of a blow count: that of a single boring [blows]. Assumed.
LEAST_COUNT_STD = 2.0
#: Share of the scatter's prior variance that goes where the slides determine it.
TOLD_SCATTER = 0.5


def slide_of(case: Case, results: str | Path) -> SlideEvidence:
    """What the results of a case say, with the blow count of its zones.

    Args:
        case: a section.
        results: folder of its results.

    Raises:
        InputError: no results, results of another case, or none that can be used.
    """
    drawn = not (case.folder / DIMENSIONS_FILE).is_file()
    verb = "invert" if drawn else "posterior"
    found = evidence_of(results, f"flowslide {verb} {case.name}", drawn=drawn)
    if found.case != case.name:
        raise InputError(f"{found.source}: is of the case {found.case!r}, not {case.name!r}")
    recalled = _recalled_measurements(case, found.fitted) if drawn else _recalled_dimensions(case)
    kind: Kind = "recalled" if recalled and found.tells else found.kind
    return replace(
        found, blow_count=_blow_count(case, found.zones), kind=kind, recalled=tuple(recalled)
    )


def save(slides: Sequence[SlideEvidence], config: Config, folder: Path) -> JointDocument:
    """Find the relation of the slides and write `joint.json`.

    Raises:
        InputError: fewer than two slides say something, or a case stands twice.
    """
    document = document_of(slides, config)
    write_json(folder / FILE_NAME, document.model_dump(mode="json"))
    return document


def document_of(slides: Sequence[SlideEvidence], config: Config) -> JointDocument:
    """The relation of the slides; errors as of `save`."""
    _check(slides)
    found, ranges = joint.infer(slides, config.posterior), load_ranges()
    before, relation = joint.on_grid("before the slides", []), joint.answer(found)
    narrowed = 1.0 - (relation.scatter.std / before.scatter.std) ** 2
    slope = joint.slope(slides)
    return JointDocument(
        slides=[
            joint.slide_row(one, joint.with_doubt([other for other in slides if other is not one]))
            for one in slides
        ],
        priors=_priors(),
        before=before,
        relation=relation,
        readings=joint.readings(slides),
        log_evidence_std=round(found.sampled.log_evidence_std, 4),
        log_evidence_on_grid=round(found.grid.log_evidence, 4),
        ratio=joint.spread(found.ratios),
        ratio_quantiles=joint.quantiles(found.ratios),
        scatter_narrowed=round(max(narrowed, 0.0), 4),
        slope=slope,
        bounds=joint.bounds(slides, ranges),
        explanations=joint.explanations(slides),
        left_out=joint.left_out(slides),
        published=[row for one in slides for row in _published(one)],
        authors=[row for one in slides for row in _authors(one)],
        secondary=joint.secondary(ranges, SOURCE),
        remarks=_remarks(slides, narrowed),
        manifest=manifest(config, seeds={"posterior": config.posterior.seed}),
    )


def _check(slides: Sequence[SlideEvidence]) -> None:
    names = [one.case for one in slides]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"CASES: {name!r} stands twice; a slide counts once")
    telling = [one for one in slides if one.tells]
    if len(telling) < 2:
        memory = [f"{one.case} ({', '.join(one.recalled)})" for one in slides if one.recalled]
        raise InputError(
            f"CASES: {len(telling)} of {len(slides)} slides says something of its strength; a "
            "relation needs two"
            + (f"; left out, as they rest on recalled numbers: {', '.join(memory)}" * bool(memory))
        )


def _priors() -> dict[str, str]:
    low, high = RATIOS
    return {
        "median ratio": f"uniform in its logarithm, {low:g} to {high:g}",
        "scatter of ln ratio": f"half-normal, {TAU_STD:g}",
        "slope per blow": f"normal, 0 ± {SLOPE_STD:g}",
        "bound": f"holds with probability {1.0 - joint.ZONE_DOUBT:g}",
    }


def _recalled_measurements(case: Case, fitted: Sequence[str]) -> list[str]:
    """Names of fitted measurements that are known from memory alone."""
    entries = [] if case.survey is None else itertools.chain(*case.survey.sets.values())
    found = (one.name for one in entries if one.confidence == "recalled" and one.name in fitted)
    return list(dict.fromkeys(found))


def _recalled_dimensions(case: Case) -> list[str]:
    """Keys of stated numbers that are known from memory alone."""
    return load_dimensions(case.folder).recalled


def _blow_count(case: Case, zones: Sequence[str]) -> BlowCountOfSlide | None:
    """Mean over the zones that have one; None: none has."""
    known = load_blow_counts(case.folder, case.scene)
    counts = [known[zone] for zone in zones if zone in known]
    if not counts:
        return None
    values = np.array([one.of_kind(clean_sand=False) for one in counts])
    return BlowCountOfSlide(
        float(values.mean()),
        max(float(values.std()), LEAST_COUNT_STD),
        any(one.confidence == "recalled" for one in counts),
    )


def _published(slide: SlideEvidence) -> list[PublishedRatio]:
    """Published relations at the blow count of a slide and its stress."""
    if slide.blow_count is None or not math.isfinite(slide.sigma_v0_kpa):
        return []
    count, stress = slide.blow_count.value, slide.sigma_v0_kpa
    return [
        PublishedRatio(
            case=slide.case,
            label=one.label,
            ratio=round(one.strength(count, stress) / stress, 5),
            beyond=one.beyond(count),
            recalled=slide.blow_count.recalled,
        )
        for one in RELATIONS.values()
    ]


def _authors(slide: SlideEvidence) -> list[Author]:
    """Strengths that others found of zones of a slide."""
    names = {entry.name for entry in load_catalogue() if entry.case == slide.case}
    found = []
    for one in load_strengths():
        if one.name not in names or not set(one.zones) & set(slide.zones):
            continue
        own = one.ratio
        found.append(
            Author(
                case=slide.case,
                source=one.source,
                part=one.part,
                ratio=round(one.s_r_kpa / slide.sigma_v0_kpa if own is None else own, 5),
                own_stress=own is not None,
                recalled=one.recalled,
            )
        )
    return found


def _remarks(slides: Sequence[SlideEvidence], narrowed: float) -> list[str]:
    """What is to be known of the answer."""
    found = [
        "The slides were chosen because they ran: soils that liquefied and stood are missing, so "
        "the relation is one of soils that flowed."
    ]
    if narrowed < TOLD_SCATTER:
        found.append("The scatter between slides is mostly its prior's: too few slides.")
    for one in slides:
        if one.kind == "recalled":
            found.append(
                f"{one.title}: rests on recalled numbers ({', '.join(one.recalled)}) and enters no "
                "regression; its file says how each number is known."
            )
        elif one.kind == "undetermined":
            found.append(f"{one.title}: its data leave the strength open; it says nothing here.")
        elif not one.drawn:
            found.append(
                f"{one.title}: known by a few numbers; what they leave open of its section is in "
                "its posterior, and the mean range of all verdicts is taken."
            )
        elif not one.verdict:
            found.append(
                f"{one.title}: no diagnosis is at hand; the mean range of all verdicts is taken "
                f"(`flowslide diagnose {one.case}` gives its own)."
            )
        if one.blow_count is not None and one.blow_count.recalled:
            found.append(
                f"{one.title}: its blow count is recalled and unverified; it enters no regression."
            )
    return found
