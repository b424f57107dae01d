"""What a benchmark is made of: `benchmark.yaml`, and where its files lie.

Under one folder: `sealed.json`, before any diagnosis (name, section, survey, hash of the truth);
`cases/<name>/`, all that a diagnosis sees; `truths/<name>.json`, opened by the score alone;
`verdicts/<variant>/<name>.json`, digests of the verdicts.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

from pydantic import Field, ValidationError

from benchmarks.hidden_effects.foreign.hidden import THINGS
from benchmarks.hidden_effects.foreign.slide import source
from benchmarks.hidden_effects.making.plan import ROUND, Kind, Planned, Reach, plan
from benchmarks.hidden_effects.making.sections import Section, load_section
from benchmarks.hidden_effects.making.surveys import SURVEYS
from diagnosis.hypotheses.section import top_of_liquefied_soil
from diagnosis.hypotheses.soil import WORDS
from diagnosis.question import CodeError
from geometry.scenes.scene import Document, checked_document, document_error
from mpm_taichi.effects import effects, load_effects_file
from pipeline.cli import InputError
from pipeline.files import file_or_within, read_yaml

FILE_NAME = "benchmark.yaml"


class SourcePlan(Document):
    """What another code makes of a set."""

    share: int = Field(1, gt=0, description="cases of it in a round of all codes")
    sections: list[str] | None = Field(
        None, min_length=1, description="where it agrees if nothing is hidden; null: all"
    )
    contact: Literal["rough", "no_slip"] | None = Field(
        None, description="contact of the ground of its sections; null: as drawn"
    )
    strength: float = Field(
        0.0,
        ge=0,
        lt=1,
        description="how far the strength is off by which the judge's solver "
        "imitates it, as a share; `source_strength` of every diagnosis.yaml",
    )
    effects: float = Field(
        0.0,
        ge=0,
        lt=1,
        description="how far what an effect does differs from what it does by the judge's solver, "
        "as a share; `source_effects` of every diagnosis.yaml",
    )
    error: dict[str, CodeError] = Field(
        default_factory=dict,
        description="type of measurement -> how far it differs from that; `source` of every "
        "diagnosis.yaml",
    )

    @property
    def known_to_the_judge(self) -> dict[str, Any]:
        """As `diagnosis.yaml` has it."""
        errors = {name: one.model_dump(exclude_none=True) for name, one in self.error.items()}
        stated = {
            "source_strength": self.strength,
            "source_effects": self.effects,
            "source": errors,
        }
        return {key: value for key, value in stated.items() if value}


class Stated(Document):
    """What every case says of what is not calibrated: one standard deviation of each."""

    boundary_m: float = Field(gt=0, description="of the top of the liquefied soil [m]")
    friction_deg: float = Field(gt=0, description="of the angles of other soils [degrees]")
    cohesion_share: float = Field(gt=0, description="of their cohesions, over their value")
    density_share: float = Field(gt=0, description="of all densities, over their value")

    def sensitivities(self, section: Section) -> list[dict[str, Any]]:
        """As `inversion.yaml` has them."""
        scene = section.scene
        top = top_of_liquefied_soil(scene, self.boundary_m)
        found = [] if top is None else [top.model_dump(mode="json", exclude_defaults=True)]
        calibrated = {
            (zone, spec.property) for spec in section.question.parameters for zone in spec.zones
        }
        for zone in scene.zones:
            soil = scene.materials[zone.material]
            stds = {
                "friction_deg": self.friction_deg if soil.friction_deg else 0.0,
                "cohesion_kpa": 0.0 if soil.liquefied else self.cohesion_share * soil.cohesion_kpa,
                "density": self.density_share * soil.density,
            }
            found += [
                {"name": f"{WORDS[key][0]} of zone {zone.name}", "kind": "property",
                 "zones": [zone.name], "property": key, "std": round(std, 3)}
                for key, std in stds.items()
                if std > 0.0 and (zone.name, key) not in calibrated
            ]  # fmt: skip
        return found


class Bound(Document):
    """How many cases a figure of the score may count."""

    at_least: int | None = Field(None, ge=0)
    at_most: int | None = Field(None, ge=0)


class BenchmarkPlan(Document):
    """The whole of `benchmark.yaml`."""

    cases: int = Field(gt=0, description="number of cases")
    seed: int = Field(ge=0, description="of every drawing, and of the salts")
    sections: list[str] = Field(min_length=1, description="folders next to this file")
    surveys: list[str] = Field(min_length=1, description="sets of measurements")
    kinds: list[Kind] = Field(
        list(ROUND), min_length=1, description="of the cases of a round, before they are shuffled"
    )
    effects: list[str] | None = Field(
        None, description="of the library; null: all that need no place"
    )
    outside: str | None = Field(None, description="Python file of effects outside the library")
    laws: dict[str, str | None] = Field(
        default_factory=dict,
        description="effect outside the library -> what its strength depends on; null: no strength",
    )
    other_realisation: list[str] = Field(
        default_factory=list,
        description="effects of the library that are random: hidden with another seed than the "
        "judge's, so that they count as outside the library",
    )
    duration_s: float = Field(40.0, gt=0, description="longest slide [s]")
    water: Literal["buoyant", "pore_pressure"] = Field(
        "pore_pressure", description="simulation.water of the truths and of the judge"
    )
    sources: dict[str, SourcePlan] = Field(
        default_factory=dict,
        description="other codes that make the truths (`foreign`); empty: the judge's solver",
    )
    slides: int = Field(
        3, gt=0, description="of another code, drawn at most until what is hidden can well be seen"
    )
    spacing_factor: float = Field(1.0, gt=0, description="spacing of the judge over the sections'")
    things: list[str] = Field(
        default_factory=list,
        description="what may be hidden by another code; empty: what the first four sets hide",
    )
    sizes: dict[str, list[tuple[float, float]]] = Field(
        default_factory=dict,
        description="thing hidden by another code -> ranges of its amplitude, in place of its own",
    )
    promises: dict[str, Bound] = Field(
        default_factory=dict,
        description="figure of the score -> cases that it counts, where the benchmark is a test",
    )
    stated: Stated | None = Field(
        None, description="sensitivities of every inversion.yaml; null: those of the sections"
    )


@dataclass(frozen=True)
class Benchmark:
    """A benchmark that was read.

    Attributes:
        plan: the document.
        sections: by name, at the judge's spacing.
        library: names of the effects that may be hidden and are known to the judge.
        outside: names of the effects that are not.
    """

    plan: BenchmarkPlan
    sections: dict[str, Section]
    library: list[str]
    outside: list[str]

    def section(self, truth: Mapping[str, Any]) -> Section:
        """The section of a truth, on the ground that its source asks for.

        Raises:
            InputError: the benchmark has no such section.
        """
        found = self.sections.get(truth["section"])
        if found is None:
            raise InputError(
                f"{truth['name']}: section: {truth['section']!r} is not in this benchmark; it has "
                f"{', '.join(self.sections)}"
            )
        return self.sections_of(truth["source"])[found.name] if truth.get("source") else found

    def sections_of(self, code: str) -> dict[str, Section]:
        """The sections on which another code makes slides, on the ground that it asks for."""
        wanted = self.plan.sources[code]
        return {
            name: _on(self.sections[name], wanted.contact)
            for name in wanted.sections or self.sections
        }

    def cases(self, reach: Reach) -> list[Planned]:
        """The row of cases."""
        return plan(
            self.plan.cases,
            seed=self.plan.seed,
            effects=self.library,
            outside=self.outside,
            sections=list(self.sections),
            surveys=self.plan.surveys,
            reach=reach,
            kinds=self.plan.kinds,
        )


def benchmark_file(text: str | Path) -> Path:
    """The document of a benchmark that is named by it or by its folder."""
    return file_or_within(text, FILE_NAME)


def load_plan(text: str | Path) -> BenchmarkPlan:
    """Read what is planned alone: whoever judges must not know effects outside the library.

    Raises:
        InputError: no such file, or it does not hold together; one line.
    """
    path = benchmark_file(text)
    return checked_document(BenchmarkPlan, read_yaml(path), path)


def load_benchmark(text: str | Path) -> Benchmark:
    """Read a benchmark; effects outside the library are loaded from the file that it names.

    Args:
        text: the document, or its folder.

    Raises:
        InputError: a file that is missing or does not hold together; one line.
    """
    path = benchmark_file(text)
    folder = path.parent
    wanted = load_plan(text)
    for survey in wanted.surveys:
        if survey not in SURVEYS:
            raise InputError(f"{path}: surveys: {survey!r}: allowed are {', '.join(SURVEYS)}")
    for code, one in wanted.sources.items():
        source(code)
        for name in one.sections or ():
            if name not in wanted.sections:
                allowed = ", ".join(wanted.sections)
                raise InputError(f"{path}: sources: {code}: {name!r}: allowed are {allowed}")
    library = list(effects())
    for name in wanted.effects or ():
        if name not in library:
            raise InputError(f"{path}: effects: {name!r} is unknown; known: {', '.join(library)}")
    for key in ("things", "sizes"):
        for name in getattr(wanted, key):
            if name not in THINGS:
                raise InputError(f"{path}: {key}: {name!r}: allowed are {', '.join(THINGS)}")
    outside = list(wanted.other_realisation)
    if wanted.outside is not None:
        outside += [one.name for one in load_effects_file(folder / wanted.outside)]
    for name in outside:
        if name not in wanted.laws:
            raise InputError(f"{path}: laws: {name}: missing; a variable, or null")
    sections = {
        name: coarser(load_section(folder / "sections" / name), wanted.spacing_factor, str(path))
        for name in wanted.sections
    }
    pushing = [name for name, one in sections.items() if one.scene.head_falls]
    if wanted.sources and wanted.water != "buoyant" and pushing:
        raise InputError(
            f"{path}: water: {wanted.water}: slides of other codes have water as weight alone, "
            f"which is the same where it is level; not so in {', '.join(pushing)}"
        )
    everywhere = [name for name, one in effects().items() if not one.place]
    inside = [name for name in wanted.effects or everywhere if name not in outside]
    return Benchmark(wanted, sections, inside, outside)


def _on(section: Section, contact: str | None) -> Section:
    """The section on ground of another contact; None: as drawn."""
    if contact is None:
        return section
    ground = section.scene.ground.model_dump() | {"contact": contact}
    return replace(section, scene=section.scene.changed(ground=ground))


def coarser(section: Section, factor: float, source: str) -> Section:
    """The section at another spacing.

    Raises:
        InputError: it is not available at that spacing; `source` is the file that asks for it.
    """
    try:
        scene = section.scene.changed(spacing=factor * section.scene.spacing)
    except ValidationError as error:
        where = f"{source}: spacing_factor {factor:g}: {section.folder}"
        raise InputError(document_error(error, where)) from None
    return Section(section.folder, scene, section.question, section.survey)


@dataclass(frozen=True)
class Places:
    """Where the files of a benchmark lie."""

    out: Path

    @property
    def sealed(self) -> Path:
        """Hashes of the truths."""
        return self.out / "sealed.json"

    @property
    def skipped(self) -> Path:
        """Planned cases that could not be made."""
        return self.out / "skipped.json"

    @property
    def reach(self) -> Path:
        """How well each effect can be seen at all."""
        return self.out / "reach.json"

    def case(self, name: str) -> Path:
        """Folder of what a diagnosis sees."""
        return self.out / "cases" / name

    def truth(self, name: str) -> Path:
        """The sealed truth."""
        return self.out / "truths" / f"{name}.json"

    def verdict(self, name: str, variant: str) -> Path:
        """Digest of a verdict; a variant is the method or an ablation."""
        return self.out / "verdicts" / variant / f"{name}.json"
