"""`blind run`: every sealed case is diagnosed from its survey, by the method and by its ablations.

Cases run one after another in one process, so that the solver's kernels are made once; several
processes share them by `--part`. A verdict that is there is not made again. The ablations look at
the same runs as the method, so that most of theirs cost nothing.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from benchmarks.hidden_effects.making.benchmark import Places
from benchmarks.hidden_effects.making.make import OnCase, sealed_cases
from benchmarks.hidden_effects.scoring.digest import METHOD, Digest, digest_of
from diagnosis.case import diagnosis_case
from geometry.case import load_case
from inversion.engines.run_store import RunStore
from pipeline.cli import WorkFailed
from pipeline.config import Config
from pipeline.files import write_json

#: Variant -> options that differ from the method's.
VARIANTS: dict[str, dict[str, Any]] = {
    METHOD: {},
    "no_model_error": {"numerical_covariance": False},
    "no_projection": {"projection": False},
    "tangent_only": {"finite_amplitudes": False},
}

Judge = Callable[[Path, str, RunStore, Config], Digest]
"""(case folder, variant, store of its runs, configuration) -> digest of the verdict."""


@dataclass(frozen=True)
class Part:
    """Every n-th case, from the k-th on; for several processes side by side."""

    k: int = 0
    n: int = 1


def diagnosed(folder: Path, variant: str, store: RunStore, config: Config) -> Digest:
    """The verdict of the diagnosis on one case, short."""
    from diagnosis.diagnose import diagnose  # scipy takes its time
    from diagnosis.verdict.verdict_builder import verdict_document

    began = time.perf_counter()
    case = diagnosis_case(load_case(folder, config))
    model = case.model(store)
    options = replace(case.options(model), **VARIANTS[variant])
    verdict = verdict_document(diagnose(model, options), case=case.name, title=case.title)
    seconds = time.perf_counter() - began
    return digest_of(verdict).model_copy(update={"seconds": round(seconds, 2)})


def run(
    places: Places,
    config: Config,
    *,
    variants: Sequence[str] = (METHOD,),
    part: Part = Part(),  # noqa: B008 - frozen
    threads: int | None = None,
    runs: str | Path | None = None,
    judge: Judge = diagnosed,
    on_case: OnCase = lambda done, total, words: None,
) -> None:
    """Diagnose the sealed cases that have no verdict yet.

    Args:
        places: of the benchmark.
        config: settings of the diagnosis.
        variants: of `VARIANTS`.
        part: which cases.
        threads: CPU threads; None: all.
        runs: folder of the simulations; None: those of a case are in memory while it is judged.
        judge: what diagnoses.
        on_case: called for each case.

    Raises:
        InputError: the benchmark has not been sealed.
    """
    mine = sealed_cases(places)[part.k :: part.n]
    for number, sealed in enumerate(mine, start=1):
        name = sealed["name"]
        missing = [v for v in variants if not places.verdict(name, v).is_file()]
        store = RunStore(runs, threads=threads)
        words = []
        for variant in missing:
            try:
                digest = judge(places.case(name), variant, store, config)
            except WorkFailed as error:
                raise WorkFailed(f"{name}: {variant}: {error}") from None
            write_json(places.verdict(name, variant), digest.model_dump(mode="json"))
            words.append(f"{digest.verdict} {' + '.join(digest.effects)}".strip())
        on_case(number, len(mine), f"{name}: {', '.join(words) or 'was there'}")
