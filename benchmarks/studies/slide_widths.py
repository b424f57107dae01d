"""Was plane strain good enough? Slides of known width, judged by the plane solver.

    python -m benchmarks.studies.slide_widths [--slides 24] [--page]

Each slide is a section of the blind benchmark (`benchmarks/hidden_effects/sections`), extruded over
2 to 20 of its heights between rough flanks, with drawn strengths. It is simulated in three
dimensions with smaller cells than the judge's and surveyed on its middle section, with the
benchmark's errors of a survey. The judge is the diagnosis in plane strain, which knows no width.
Afterwards `side_shear` and `side_friction` are fitted, whatever was named: their amplitude stands
for H / B. A twin of each slide has the same strengths, cells and survey errors in plane strain:
what the judge finds of both differs by the width alone.

A truth is sealed: until the judge has spoken the record has its hash alone, and it is opened only
if it is what was sealed.

What is done is kept in `slide_widths.json`, slide by slide, and runs in
`results/benchmarks/slide_widths`, so that a study that was stopped resumes. At the end the page
`docs/records/numerical-choices.md` and its picture are renewed; `--page` does only that.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.generated_pages import RECORDS, ROOT, renew, table
from benchmarks.hidden_effects.making import surveys
from benchmarks.hidden_effects.making.benchmark import Places
from benchmarks.hidden_effects.making.make import write_case
from benchmarks.hidden_effects.making.plan import Planned
from benchmarks.hidden_effects.making.seal import SALT, is_sealed, salt_of, seal
from benchmarks.hidden_effects.making.sections import Section, load_section, normal
from benchmarks.hidden_effects.making.sight import is_slide
from benchmarks.hidden_effects.making.truth import Made
from benchmarks.hidden_effects.scoring.digest import digest_of
from diagnosis.adequacy.compare import compare
from diagnosis.case import DiagnosisCase, diagnosis_case
from diagnosis.diagnose import Diagnosis, diagnose
from diagnosis.selection.refit import refit
from diagnosis.verdict.verdict_builder import verdict_document
from geometry.case import load_case
from geometry.scenes.scene import Scene
from geometry.scenes3d.scene3d import Section as Width
from geometry.survey.measured import Deposit
from inversion.engines.run_store import RunStore
from inversion.engines.run_store_3d import RunStore3d
from inversion.estimation.forward import deposit_of_run
from mpm_taichi.effects import effect as effect_of
from mpm_taichi.trajectory import Run
from pipeline.cli import WorkFailed
from pipeline.config import Config, SimulationSettings, load_config
from pipeline.files import read_json, write_json
from pipeline.manifest import code_version
from pipeline.random_numbers import Stream, number_of
from report import style

RECORD = Path(__file__).with_suffix(".json")
PAGE = RECORDS / "numerical-choices.md"
PICTURE = ROOT / "docs/images/slide-widths.png"
FOLDER = ROOT / "results/benchmarks/slide_widths"
SECTIONS = ("embankment", "tailings_dam", "reservoir_dam")
SURVEYS = ("profile", "markers", "history")
#: Slides; width over the height of the section, drawn in the logarithm.
SLIDES, WIDTHS = 24, (2.0, 20.0)
#: Spacing and jitter of a slide; drawings of it, at most.
FINER, JITTER, DRAWS = 0.8, 0.5, 6
#: Room beyond the open ends of a section, whose walls are closed in three dimensions [m].
ROOM = 100.0
#: Spacings by which a slide must stop before its twin for an effect to imitate it; largest H / B
#: that is tried; halvings of an interval of amplitudes.
SEEN, MOST, HALVINGS = 0.5, 8.0, 5
SEED, DURATION_S = 5021, 40.0
WATER = "buoyant"
#: Effects that stand for flanks.
FLANKS = ("side_shear", "side_friction")
OTHER = style.HELD_OUT

Record = dict[str, Any]


def width_of(number: int) -> float:
    """Width over height of a slide: one from each class of width, any few far from each other."""
    order = np.argsort([int(f"{k:05b}"[::-1], 2) for k in range(SLIDES)])
    share = (float(order[number]) + Stream(SEED, number).unit()) / SLIDES
    return float(np.exp(np.interp(share, (0.0, 1.0), np.log(WIDTHS))))


def height_of(scene: Scene) -> float:
    """H as the effects have it [m]."""
    return max(y for zone in scene.zones for _, y in zone.polygon) - scene.ground.lowest


def settings_of(config: Config) -> SimulationSettings:
    """Of every run of the study."""
    return config.simulation.model_copy(update={"duration_s": DURATION_S, "water": WATER})


def deposit_of(section: Section, run: Run) -> Deposit:
    """A run as its surveyor sees it: feet are those of the section that the judge is given."""
    return deposit_of_run(run, {side: section.scene.foot(side) for side in ("left", "right")})


def plane(scene: Scene, settings: SimulationSettings) -> Run:
    """The twin of a slide."""
    from mpm_taichi.simulate import simulate

    with redirect_stdout(sys.stderr):
        return simulate([scene], settings, threads=1)[0]


def section_of(number: int) -> Section:
    """The section of a slide; the second half has others at like widths than the first."""
    name = SECTIONS[(number + number // (SLIDES // 2)) % len(SECTIONS)]
    return load_section(ROOT / "benchmarks/hidden_effects/sections" / name)


def solid_of(number: int, section: Section) -> RunStore3d:
    """What simulates a slide: its width in whole cells, walls where no soil comes."""
    cell = 2.0 * spacing_of(section)
    width = cell * round(width_of(number) * height_of(section.scene) / cell)
    domain = section.scene.domain
    room = ROOM if domain.walls == "open" else 0.0
    ends = {"x_min": domain.x_min - room, "x_max": domain.x_max + room}
    return RunStore3d(Width(file="", width_m=width, **ends), "rough", None, threads=1)


def spacing_of(section: Section) -> float:
    """Of a slide and its twin [m]."""
    return round(FINER * section.scene.spacing, 4)


def drawn(number: int, section: Section) -> Iterator[tuple[np.ndarray, Scene]]:
    """Drawings of a slide: true parameters (p,), and the section with them."""
    stream = Stream(SEED, number_of("slide"), number)
    for _ in range(DRAWS):
        values = np.round(section.draw(stream), 6)
        yield (
            values,
            section.parameters.scene(section.scene, values).changed(
                spacing=spacing_of(section), jitter=JITTER, seed=stream.seed() % 2**31
            ),
        )


def make(number: int, config: Config) -> Record:
    """Simulate a slide and its twin, write both as cases, and seal what is true of them.

    Raises:
        WorkFailed: no drawing gave a slide that can be surveyed.
    """
    section = section_of(number)
    survey = SURVEYS[number // len(SECTIONS) % len(SURVEYS)]
    solid, settings = solid_of(number, section), settings_of(config)
    width, height = solid.section.width_m, height_of(section.scene)
    for values, scene in drawn(number, section):
        flat = plane(solid.walled(scene), settings)
        run = solid.simulate(scene, settings)
        pair = {"slide": deposit_of(section, run), "twin": deposit_of(section, flat)}
        errors = Stream(SEED, number_of("survey"), number)
        noise = np.array([normal(errors) for _ in range(100)])
        if all(is_slide(section, one) and one.at_rest for one in pair.values()):
            true = values.tolist()
            break
    else:
        raise WorkFailed(f"slide {number}: no flow slide that comes to rest")
    toes = {}
    for name, deposit in pair.items():
        toe = surveys.toe_of(section, deposit)
        toes[name] = round(abs(toe - deposit.foot[section.survey.side]), 2)
        where = surveys.profile_places(section, toe)
        entries = surveys.with_values(section, survey, where, None)
        lower = np.linalg.cholesky(surveys.covariance_of(entries))
        measured = np.round(surveys.reading(entries, deposit) + lower @ noise[: len(lower)], 3)
        documents = surveys.documents(section, survey, measured, where)
        profile = np.column_stack([where, measured[: len(where)]])
        planned = Planned(f"{name}_{number:02d}", "single", (), section.name, survey, 0)
        write_case(section, planned, Made({}, documents, profile), Places(FOLDER), DURATION_S)
    truth = {
        "section": section.name, "survey": survey, "width_m": width,
        "width": round(width / height, 3), "toe_m": toes,
        "true": dict(zip(section.parameters.names, true, strict=True)),
        "points": len(run.zone) * round(width / scene.spacing), "seconds": round(run.wall_time_s),
        SALT: salt_of(SEED, f"{number:02d}"),
    }  # fmt: skip
    write_json(Places(FOLDER).truth(f"{number:02d}"), truth)
    return {"sealed": seal(truth)}


def opened(number: int, sealed: str) -> Record:
    """The truth of a slide that has been judged.

    Raises:
        WorkFailed: it is not what was sealed.
    """
    truth: Record = read_json(Places(FOLDER).truth(f"{number:02d}"))
    if not is_sealed(truth, sealed):
        raise WorkFailed(f"slide {number}: its truth is not the one that was sealed")
    return truth


def imitated(number: int, one: Record, config: Config) -> Record:
    """Amplitudes with which the plane twin runs as far as the slide, its strengths being the true.

    Where the slide stops less than `SEEN` spacings before its twin there is nothing to imitate.
    """
    section = section_of(number)
    solid, settings = solid_of(number, section), settings_of(config)
    true = list(one["true"].values())
    scene = next(scene for values, scene in drawn(number, section) if values.tolist() == true)
    walled = solid.walled(scene)
    foot, target = section.scene.foot(section.survey.side), one["toe_m"]["slide"]
    if one["toe_m"]["twin"] - target < SEEN * scene.spacing:
        return {}

    def beyond(name: str, amplitude: float) -> float:
        run = plane(walled.changed(effects={name: amplitude}), settings)
        return abs(surveys.toe_of(section, deposit_of(section, run)) - foot) - target

    found = {}
    for name in FLANKS:
        if effect_of(name).applies(walled):
            continue
        low, high = 0.0, 1.0 / one["width"]
        while beyond(name, high) > 0.0 and high < MOST:
            low, high = high, 2.0 * high
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if beyond(name, middle) > 0.0 else (low, middle)
        found[name] = round(0.5 * (low + high), 4)
    return found


def asked(name: str, number: int, config: Config) -> tuple[DiagnosisCase, RunStore]:
    """A case as the judge is given it, and the store of its runs."""
    folder = Places(FOLDER).case(f"{name}_{number:02d}")
    return diagnosis_case(load_case(folder, config)), RunStore(FOLDER / "runs", threads=1)


def judge(number: int, config: Config) -> Record:
    """What the plane judge says of a slide, and of its twin where nothing is missing."""
    case, store = asked("slide", number, config)
    model = case.model(store)
    found = diagnose(model, case.options(model))
    digest = digest_of(verdict_document(found, case=case.name, title=case.title))
    twin, store = asked("twin", number, config)
    model = twin.model(store)
    alone = compare(model, twin.options(model))
    names = alone.base.fit.space.parameters.names
    return {
        "verdict": digest.verdict, "named": digest.effects, "set_90": digest.set_90,
        "base": digest.base.model_dump(), "final": digest.final.model_dump(),
        "quoted": digest.quoted, "runs": digest.runs, "p": found.explanation.adequacy.p_combined,
        "flanks": {name: one for name in FLANKS if (one := flanked(found, name)) is not None},
        "twin": {
            "values": dict(zip(names, values_of(alone.base.fit), strict=True)),
            "chi2": float(alone.base.fit.total), "p": alone.adequacy.p_combined,
        },
    }  # fmt: skip


def values_of(fit: Any) -> list[float]:
    """Parameters of a fit in outside units."""
    return [float(value) for value in fit.space.values(fit.x)]


def flanked(found: Diagnosis, name: str) -> Record | None:
    """One effect fitted with the parameters, whatever the diagnosis has said; None: it cannot be.

    The search begins along the valley of the effect, as in a diagnosis.
    """
    signature = found.explanation.signatures.get(name)
    if signature is None:
        return None
    base = found.comparison.base
    base.runs.allowance += 60
    model = found.tried_models.models.get((name,)) or refit(
        found.explanation.context,
        base.surface.with_ladders({name: signature.ladder}),
        (name,),
        seeds=base.seeds,
    )
    if model is None:
        return None
    fit = model.fit
    return {
        "amplitude": fit.space.amplitudes(fit.x)[name],
        "values": dict(zip(fit.space.parameters.names, values_of(fit), strict=True)),
        "chi2": float(fit.total), "base_chi2": float(base.fit.total),
    }  # fmt: skip


# --- page ---

CLASSES = ((2.0, 3.0), (3.0, 5.0), (5.0, 10.0), (10.0, 20.0))
"""Of B / H, for the table."""


def strength(values: Record) -> float:
    """S_r [kPa]."""
    return float(values["residual_strength"])


def against_twin(one: Record, values: Record) -> float:
    """S_r over that of the plane twin, by the same judge and with the same errors."""
    return strength(values) / strength(one["twin"]["values"])


def figures(done: list[Record]) -> str:
    """The table by classes of width."""
    header, rows = ["B / H"], []
    for low, high in CLASSES:
        some = [one for one in done if low <= one["width"] < high]
        if not some:
            continue
        header.append(f"{low:g} to {high:g}")
        named = [one for one in some if set(one["named"]) & set(FLANKS)]
        within = [
            abs(strength(one["base"]["values"]) - one["true"]["residual_strength"])
            < 2.0 * one["base"]["std"]["residual_strength"] for one in some
        ]  # fmt: skip
        rows.append([
            str(len(some)),
            _median([one["toe_m"]["slide"] / one["toe_m"]["twin"] for one in some]),
            _median([against_twin(one, one["base"]["values"]) for one in some]),
            _median([against_twin(one, one["flanks"]["side_shear"]["values"]) for one in some]),
            _of(within),
            _of([one["verdict"] != "adequate" for one in some]),
            _of([one in named for one in some]),
            _median([one["flanks"]["side_shear"]["amplitude"] * one["width"] for one in some]),
            *(_median([one["imitated"][name] * one["width"] for one in some
                       if name in one["imitated"]]) for name in FLANKS),
        ])  # fmt: skip
    words = [
        "slides", "toe over the plane twin's", "S_r of the plane judge over the twin's",
        "the same with `side_shear` fitted", "true S_r within 2 standard deviations",
        "called inadequate, or suspect", "flanks named",
        "`side_shear` fitted with S_r: H / B over the true one",
        *(f"`{name}` that makes the toe, S_r known: H / B over the true one" for name in FLANKS),
    ]  # fmt: skip
    return table(header, list(map(list, zip(words, *rows, strict=True))))


def _of(outcomes: list[bool]) -> str:
    return f"{sum(outcomes)} of {len(outcomes)}"


def _median(values: list[float]) -> str:
    if not values:
        return "-"
    return f"{np.median(values):.2f} ({min(values):.2f} to {max(values):.2f})"


def page(done: list[Record]) -> str:
    """The generated part of the page."""
    return "\n\n".join([
        f"{len(done)} slides, the truth of {sum('sealed' in one for one in done)} sealed. Medians, "
        "with the smallest and the largest.",
        figures(done),
        "![H over B of the effects over the true one; toe and S_r over those of plane twins]"
        f"(../images/{PICTURE.name})",
        "Slide by slide: `benchmarks/studies/slide_widths.json`.",
    ])  # fmt: skip


def draw(done: list[Record]) -> None:
    """Above: H / B of the effects over the true one. Below: toe and S_r over the twin's."""
    figure = style.new_figure(5.6)
    upper, lower = figure.subplots(2, 1, sharex=True)
    for name, mark, colour in (("side_shear", "o", style.OURS), ("side_friction", "^", OTHER)):
        pairs = [(one["width"], one["imitated"][name] * one["width"]) for one in done
                 if name in one["imitated"]]  # fmt: skip
        upper.plot(*zip(*pairs, strict=True), mark, color=colour, label=f"{name}, S_r known")
    fitted = [one["flanks"]["side_shear"]["amplitude"] * one["width"] for one in done]
    width = [one["width"] for one in done]
    upper.plot(width, fitted, "x", color=style.GREY, label="side_shear, fitted with S_r")
    upper.set_ylim(-0.1, 2.9)
    upper.set_ylabel("H / B over the true one", fontsize=style.SMALL)
    toe = [one["toe_m"]["slide"] / one["toe_m"]["twin"] for one in done]
    ratio = [against_twin(one, one["base"]["values"]) for one in done]
    lower.plot(width, toe, "s", mfc="none", color=style.GREY, label="runout of the toe")
    lower.plot(width, ratio, "o", color=style.OURS, label="S_r of the plane judge")
    lower.set_ylabel("over the plane twin's", fontsize=style.SMALL)
    lower.set_xlabel("width over height, B / H", fontsize=style.SMALL)
    for axes in (upper, lower):
        axes.axhline(1.0, color=style.TEXT_COLOUR, lw=0.9)
        axes.set_xscale("log")
        axes.set_xticks([2, 3, 5, 10, 20], ["2", "3", "5", "10", "20"])
        axes.minorticks_off()
        axes.legend(fontsize=style.SMALL, frameon=False)
        axes.tick_params(labelsize=style.SMALL)
    figure.tight_layout()
    style.save_figure(figure, PICTURE)


def main() -> None:
    """Simulate, judge, keep, and renew the page."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.studies.slide_widths", description=__doc__
    )
    parser.add_argument("--slides", type=int, default=SLIDES, help="the narrowest so many")
    parser.add_argument("--page", action="store_true", help="renew the page from what is kept")
    options = parser.parse_args()
    config = load_config(None)
    config = config.model_copy(update={"simulation": settings_of(config)})
    record: Record = read_json(RECORD) if RECORD.is_file() else {"slides": {}}
    narrow_first = sorted(range(SLIDES), key=width_of)
    for number in () if options.page else narrow_first[: options.slides]:
        key = f"{number:02d}"
        one = record["slides"].setdefault(key, {})
        if not one:
            one |= make(number, config)
            write_json(RECORD, record)
        if "verdict" not in one:
            one |= judge(number, config)
            one["code_version"] = code_version()
            write_json(RECORD, record)
        if "true" not in one:
            one |= opened(number, one["sealed"])
            write_json(RECORD, record)
        if "imitated" not in one:
            one["imitated"] = imitated(number, one, config)
            write_json(RECORD, record)
        print(f"{key}: {one['section']}, B / H {one['width']}: {one['verdict']}", flush=True)
    done = [one for one in record["slides"].values() if "true" in one and "imitated" in one]
    draw(done)
    renew(PAGE, slides=page(done))


if __name__ == "__main__":
    main()
