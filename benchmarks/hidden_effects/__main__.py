"""The benchmark of hidden effects: make it, run it, score it.

python -m benchmarks.hidden_effects plan|make|reopen|run|strangers|baselines|score
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable, Collection, Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks.generated_pages import table
from benchmarks.hidden_effects.run import METHOD, VARIANTS, Part
from pipeline.cli import InputError, WorkFailed, add_common, base_parser, main_exit
from pipeline.config import Config, load_config
from pipeline.files import content_hash, read_json, write_json, write_text
from pipeline.progress import Progress

if TYPE_CHECKING:
    from benchmarks.hidden_effects.making.benchmark import Benchmark, Places
    from benchmarks.hidden_effects.making.laboratory import Laboratory

FOLDER = "benchmarks/hidden_effects"
RESULTS = "hidden_effects"
RECORD = "results.json"
#: What a score leaves: a page, and the folder of its pictures.
PAGE, PICTURES = "score.md", "score"
#: What truths, and what verdicts, follow from.
MADE_FROM, JUDGED_BY = "made_from.json", "judged_by.json"


def main(argv: Sequence[str] | None = None) -> int:
    """Make or reopen, run, score."""
    arguments = _parser().parse_args(argv)
    config = load_config(arguments.config, arguments.overrides)
    if arguments.step != "score":
        simulation = config.simulation.model_copy(update={"water": _water(arguments)})
        config = config.model_copy(update={"simulation": simulation})
    steps = {"plan": _plan, "make": _make, "reopen": _reopen, "run": _run, "score": _score,
             "strangers": _strangers, "baselines": _baselines}  # fmt: skip
    return steps[arguments.step](arguments, config)


def _parser() -> argparse.ArgumentParser:
    parser = base_parser(
        "python -m benchmarks.hidden_effects",
        "Hide effects in simulated slides, seal what is true, diagnose the surveys, "
        "and hold the verdicts against the truths (docs/records/hidden-effects.md).",
    )
    parser.add_argument(
        "step",
        choices=("plan", "make", "reopen", "run", "strangers", "baselines", "score"),
        help="plan: measure how well each effect can be seen; make: simulate and seal the cases; "
        "reopen: write the cases of an opened set from its --record; run: diagnose them; "
        "strangers: judge the slides of an opened set by a library that lacks what is hidden; "
        "baselines: what other methods say of the slides of an opened set that are diagnosed; "
        "score: open the seals, write score.md",
    )
    parser.add_argument(
        "--benchmark",
        metavar="FILE",
        default=FOLDER,
        help=f"plan of the benchmark, or its folder; default: {FOLDER}",
    )
    parser.add_argument(
        "--out", metavar="DIR", help=f"folder of its files; default: results/{RESULTS}"
    )
    parser.add_argument(
        "--part",
        metavar="K/N",
        default="1/1",
        help="make, run, strangers, baselines: the K-th of N shares of the cases, for several "
        "jobs; default: 1/1",
    )
    parser.add_argument(
        "--cases",
        metavar="NAME,...",
        help="reopen: these cases, or those with these verdicts in the record; default: all",
    )
    parser.add_argument(
        "--runs",
        metavar="DIR",
        help="run, strangers, baselines: keep the simulations here, so that another version of "
        "the method finds those that it has in common; default: in memory",
    )
    parser.add_argument(
        "--variants",
        metavar="NAME,...",
        help=f"run: all, or some of {', '.join(VARIANTS)}; default: {METHOD}",
    )
    parser.add_argument(
        "--record",
        metavar="FILE",
        help="score: where truths and verdicts are kept; given without --out's verdicts, it is "
        f"read instead; default: <out>/{RECORD}; reopen: the record; strangers, baselines: where "
        "what they say is added; default: the one that is shipped",
    )
    parser.add_argument("--threads", type=int, metavar="N", help="CPU threads; default: all")
    return add_common(parser)


def part_of(text: str) -> Part:
    """The share of the cases that is written as K/N.

    Raises:
        InputError: it is not.
    """
    found = re.fullmatch(r"(\d+)/(\d+)", text)
    if found is None or not 1 <= int(found[1]) <= int(found[2]):
        raise InputError(f"--part: {text!r}: allowed is K/N with K from 1 to N")
    return Part(int(found[1]) - 1, int(found[2]))


def variants_of(text: str | None, default: str, known: Collection[str]) -> list[str]:
    """The variants that are named, those that are known for `all`, one for None.

    Raises:
        InputError: one does not exist.
    """
    text = text or default
    names = list(known) if text == "all" else [name.strip() for name in text.split(",")]
    for name in names:
        if name not in known:
            raise InputError(f"--variants: {name!r}: allowed are all, {', '.join(known)}")
    return names


def _out(arguments: argparse.Namespace, config: Config) -> Path:
    return Path(config.results_folder) / RESULTS if arguments.out is None else Path(arguments.out)


def _water(arguments: argparse.Namespace) -> str:
    """Form of the water that the plan of the benchmark asks for."""
    from benchmarks.hidden_effects.making.benchmark import load_plan

    return load_plan(arguments.benchmark).water


def _workshop(arguments: argparse.Namespace, config: Config) -> tuple[Benchmark, Laboratory]:
    from benchmarks.hidden_effects.making.benchmark import load_benchmark
    from benchmarks.hidden_effects.making.laboratory import Laboratory

    benchmark = load_benchmark(arguments.benchmark)
    settings = config.simulation.model_copy(update={"duration_s": benchmark.plan.duration_s})
    return benchmark, Laboratory(settings, threads=arguments.threads)


def _plan(arguments: argparse.Namespace, config: Config) -> int:
    from benchmarks.hidden_effects.making.benchmark import Places
    from benchmarks.hidden_effects.making.make import reach_of

    benchmark, laboratory = _workshop(arguments, config)
    places = Places(_out(arguments, config))
    _keep_origin(places.out / MADE_FROM, _made_from(benchmark, config), [places.reach])
    if benchmark.plan.sources:
        write_json(places.reach, [])
        print("nothing to measure: amplitudes of slides by other codes are drawn")
        return 0
    total = len(benchmark.sections) * len((*benchmark.library, *benchmark.outside))
    with Progress(total, "looking at effects", quiet=arguments.quiet) as progress:
        reach_of(
            benchmark,
            places,
            laboratory,
            on_case=lambda done, _, words: progress.advance(1, words),
        )
    return 0


def _made_from(benchmark: Benchmark, config: Config) -> dict[str, Any]:
    """All that truths follow from."""
    import geometry
    import mpm_taichi
    from geometry.scenes.scene import scene_hash
    from mpm_taichi import effects

    return {
        "plan": benchmark.plan,
        "sections": {name: scene_hash(one.scene) for name, one in benchmark.sections.items()},
        "simulation": config.simulation,
        "physics": [one.PHYSICS_VERSION for one in (geometry, mpm_taichi, effects)],
    }


def _judged_by(places: Places, config: Config) -> dict[str, Any]:
    """All that verdicts follow from."""
    import diagnosis
    import geometry
    import inversion
    import mpm_taichi
    from mpm_taichi import effects
    from pipeline.files import file_hash

    packages = (geometry, mpm_taichi, effects, inversion, diagnosis)
    return {
        "sealed": file_hash(places.sealed),
        "settings": [config.simulation, config.diagnosis],
        "physics": [one.PHYSICS_VERSION for one in packages],
    }


def _keep_origin(path: Path, origin: dict[str, Any], files: Iterable[Path]) -> None:
    """Write what files follow from next to them.

    Raises:
        InputError: some are there that follow from something else: they are not mixed.
    """
    key = content_hash(origin)
    if path.is_file():
        same = read_json(path) == key
    else:
        same = not any(file.is_file() for file in files)
    if not same:
        raise InputError(
            f"{path.parent}: has files of another plan, of other settings or of an earlier "
            "version; give another folder with --out, or remove it"
        )
    write_json(path, key)


def _make(arguments: argparse.Namespace, config: Config) -> int:
    from benchmarks.hidden_effects.making.benchmark import Places
    from benchmarks.hidden_effects.making.by_other_codes import make_by_codes
    from benchmarks.hidden_effects.making.make import make

    benchmark, laboratory = _workshop(arguments, config)
    places, part = Places(_out(arguments, config)), part_of(arguments.part)
    _keep_origin(places.out / MADE_FROM, _made_from(benchmark, config),
                 [places.reach, *places.out.glob("truths/*.json")])  # fmt: skip
    total = len(range(part.k, benchmark.plan.cases, part.n))
    make_all = make_by_codes if benchmark.plan.sources else make
    with Progress(total, "making hidden effects", quiet=arguments.quiet) as progress:
        make_all(
            benchmark,
            places,
            laboratory,
            part=(part.k, part.n),
            on_case=lambda done, _, words: progress.advance(1 if done else 0, words),
        )
    return 0


def _reopen(arguments: argparse.Namespace, config: Config) -> int:
    from benchmarks.hidden_effects.making.benchmark import Places, load_benchmark
    from benchmarks.hidden_effects.making.reopen import reopen
    from benchmarks.hidden_effects.scoring.opened import load_rows

    if arguments.record is None:
        raise InputError("--record: missing; an opened set is written again from its record")
    benchmark, places = load_benchmark(arguments.benchmark), Places(_out(arguments, config))
    names = [name.strip() for name in (arguments.cases or "").split(",") if name.strip()]
    print(f"{reopen(load_rows(arguments.record), benchmark, places, names)} cases in {places.out}")
    return 0


def _run(arguments: argparse.Namespace, config: Config) -> int:
    from benchmarks.hidden_effects.making.benchmark import Places
    from benchmarks.hidden_effects.making.make import sealed_cases
    from benchmarks.hidden_effects.run import run

    places = Places(_out(arguments, config))
    names, variants = sealed_cases(places), variants_of(arguments.variants, METHOD, VARIANTS)
    _keep_origin(places.out / JUDGED_BY, _judged_by(places, config), _verdicts(places))
    _judged(arguments, names, "diagnosing blind", partial(run, places, config, variants=variants))
    return 0


def _strangers(arguments: argparse.Namespace, config: Config) -> int:
    from benchmarks.hidden_effects import strangers
    from benchmarks.hidden_effects.making.benchmark import Places

    places = Places(_out(arguments, config))
    names, kept = strangers.single_things(places), places.out / strangers.FOLDER
    origin = places.out / f"{strangers.FOLDER}_{JUDGED_BY}"
    _keep_origin(origin, _judged_by(places, config), kept.glob("*.json"))
    judge = partial(strangers.run_twice, places, config, Path(arguments.benchmark).stem)
    found = _judged(arguments, names, "diagnosing twice", judge)
    record = Path(arguments.record or strangers.RECORD)
    strangers.save_twice(found, record)
    print(table(strangers.HEADER, strangers.rows_of(strangers.load_twice(record))))
    return 0


def _baselines(arguments: argparse.Namespace, config: Config) -> int:
    from benchmarks.hidden_effects.baselines import curve
    from benchmarks.hidden_effects.baselines import run as baselines
    from benchmarks.hidden_effects.making.benchmark import Places

    places = Places(_out(arguments, config))
    names = baselines.judged_cases(places)
    if read_json(places.out / JUDGED_BY) != content_hash(_judged_by(places, config)):
        raise InputError(
            f"{places.out}: its verdicts follow from other settings or another version of the "
            "method; the baselines are asked with those, give the same --set"
        )
    judge = partial(baselines.run_baselines, places, config, Path(arguments.benchmark).stem)
    found = _judged(arguments, names, "asking other methods", judge)
    record = Path(arguments.record or baselines.RECORD)
    baselines.save_answers(found, record)
    print(table(curve.HEADER, curve.rows_of(baselines.load_answers(record))))
    return 0


def _judged(
    arguments: argparse.Namespace, names: Sequence[Any], words: str, judge: Callable[..., Any]
) -> Any:
    """What is found of this job's share of some cases."""
    part = part_of(arguments.part)
    with Progress(len(names[part.k :: part.n]), words, quiet=arguments.quiet) as progress:
        return judge(
            part=part,
            threads=arguments.threads,
            runs=arguments.runs,
            on_case=lambda done, _, words: progress.advance(1, words),
        )


def _verdicts(places: Places) -> Iterable[Path]:
    return places.out.glob("verdicts/*/*.json")


def _score(arguments: argparse.Namespace, config: Config) -> int:
    from benchmarks.hidden_effects.making.benchmark import Places, load_benchmark
    from benchmarks.hidden_effects.scoring.asked import ASKED
    from benchmarks.hidden_effects.scoring.draw import draw_all
    from benchmarks.hidden_effects.scoring.opened import (
        judged,
        load_rows,
        open_truths,
        save_rows,
        shared,
    )
    from benchmarks.hidden_effects.scoring.page import generated
    from benchmarks.hidden_effects.scoring.score import broken, score

    out = _out(arguments, config)
    places = Places(out)
    record = Path(arguments.record) if arguments.record else out / RECORD
    fresh = places.sealed.is_file()
    rows = open_truths(places, VARIANTS) if fresh else load_rows(record)
    if not rows:
        raise InputError(f"{out}: no case has been diagnosed; `blind run` does that")
    benchmark = load_benchmark(arguments.benchmark)
    if benchmark.plan.sources:
        return _score_by_codes(rows, benchmark, out, record if fresh else None)
    by_variant = {name: judged(rows, benchmark, name) for name in VARIANTS}
    scores = {name: score(cases) for name, cases in by_variant.items() if cases}
    if fresh:
        save_rows(rows, record)
    method = scores[METHOD]
    draw_all(out / PICTURES, method, by_variant[METHOD])
    ablations = {name: score(cases) for name, cases in shared(by_variant).items() if cases}
    page = generated(method, ablations, by_variant[METHOD], PICTURES)
    write_text(out / PAGE, f"# Score\n\n{page}")
    write_json(out / "score.json", {name: one.document for name, one in scores.items()})
    lines = [(one.words, method.shares[one.name].words, one.bound) for one in ASKED]
    print(table(("figure", "measured", "asked"), lines))
    if failed := broken(benchmark.plan.promises, method):
        raise WorkFailed(f"{arguments.benchmark}: not as promised: {'; '.join(failed)}")
    return 0


def _score_by_codes(
    rows: list[dict[str, Any]],
    benchmark: Benchmark,
    out: Path,
    record: Path | None,
) -> int:
    """Score a set by other codes; write the record where it is new."""
    from benchmarks.hidden_effects.scoring.by_other_codes import (
        ASKED,
        ByCode,
        score_by_codes,
        shares_of,
    )
    from benchmarks.hidden_effects.scoring.opened import judged, save_rows
    from benchmarks.hidden_effects.scoring.page_by_codes import draw_all, generated

    cases = judged(rows, benchmark, METHOD)
    if record is not None:
        save_rows(rows, record)
    document = score_by_codes(cases)
    by_code = [ByCode(one) for one in cases]
    draw_all(out / PICTURES, by_code)
    write_text(out / PAGE, f"# Score\n\n{generated(by_code, document, PICTURES)}")
    write_json(out / "score.json", document)
    shares = shares_of(by_code)
    print(table(("figure", "measured", "asked"),
                [(one.words, shares[one.name].words, one.bound) for one in ASKED]))  # fmt: skip
    print()
    print(table(("family", "right", "of"),
                [(name, str(share["hits"]), str(share["n"]))
                 for name, share in document["families"].items()]))  # fmt: skip
    return 0


if __name__ == "__main__":
    main_exit(main)
