"""What the functions of `flowslide.api` share: how a question is worked on.

`SectionOptions` and its like are the keyword arguments that a function takes in addition to its
own; a `Call` is one call with them.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, Literal, Self, TypedDict

from pipeline.config import Config, load_config
from pipeline.progress import Cancel, Evaluated, Report, Watch

if TYPE_CHECKING:
    from geometry.case import Case
    from inversion.engines.run_store import RunStore

Place = str | os.PathLike[str]
Files = Sequence[Place]


class WatchedOptions(TypedDict, total=False):
    """Of a function that computes on one core.

    Attributes:
        settings: of all stages (`flowslide.load_settings`); None: those that the case was loaded
            with, or the defaults.
        progress: called as `progress(done, total, message)` after every simulation and at every
            stage; `total` is an estimate where the number is not known beforehand.
        cancel: a function that returns True, or a `threading.Event` that is set, to stop. It is
            asked between simulations and raises `Cancelled`.
    """

    settings: Config | None
    progress: Report | None
    cancel: Cancel | None


class JointOptions(TypedDict, total=False):
    """Of a function that simulates nothing.

    Attributes:
        settings: as of `WatchedOptions`.
    """

    settings: Config | None


class BodyOptions(WatchedOptions, total=False):
    """Of a function that simulates in three dimensions.

    Attributes:
        threads: CPU threads; None: all.
    """

    threads: int | None


class SurveyOptions(WatchedOptions, total=False):
    """Of a function that reads measurements.

    Attributes:
        measurement_files: Python files with measurement types of your own. They are executed, and
            known for the length of the call only.
    """

    measurement_files: Files


class DiagnosisOptions(SurveyOptions, BodyOptions, total=False):
    """Of a diagnosis.

    Attributes:
        effect_files: Python files with effects of your own, as `measurement_files`.
    """

    effect_files: Files


class SectionOptions(DiagnosisOptions, total=False):
    """Of a function that simulates sections.

    Attributes:
        device: "cpu" or "cuda".
    """

    device: Literal["cpu", "cuda"]


@dataclass(frozen=True)
class Call:
    """One call of a function of the interface, with its options."""

    settings: Config | None = None
    progress: Report | None = None
    cancel: Cancel | None = None
    threads: int | None = None
    measurement_files: Files = ()
    effect_files: Files = ()
    device: Literal["cpu", "cuda"] = "cpu"
    evaluated: Evaluated | None = None

    @classmethod
    def of(cls, kind: type, options: Mapping[str, Any], **more: Any) -> Self:
        """A call with the options of a kind.

        Args:
            kind: `SectionOptions` or one like it.
            options: as the caller gives them.
            more: further fields.

        Raises:
            TypeError: an option that the function does not have.
        """
        for name in options:
            if name not in kind.__annotations__:
                raise TypeError(f"got an unexpected keyword argument {name!r}")
        return cls(**options, **more)

    @cached_property
    def watch(self) -> Watch:
        """Whom to report to, and who may stop the work."""
        return Watch(self.progress, self.cancel, self.evaluated)

    @cached_property
    def config(self) -> Config:
        """Settings in force where no case brings its own."""
        return self.settings or load_config(None)

    @contextmanager
    def own_code(self) -> Iterator[None]:
        """Effects and measurement types of the caller's own, for the length of a call."""
        with own_code(self.effect_files, self.measurement_files):
            yield

    @contextmanager
    def folder(self, out: Place | None) -> Iterator[Path]:
        """The folder of the results, with the caller's own code.

        Args:
            out: made where it is missing. Finished simulations are kept there, so that a call that
                was stopped continues where it was. None: nothing is kept.
        """
        with self.own_code():
            if out is not None:
                yield Path(out)
                return
            with TemporaryDirectory(prefix="flowslide_") as temporary:
                yield Path(temporary)

    def store(self, folder: Path) -> RunStore:
        """Where the runs of a call are kept."""
        from inversion.engines.run_store import RunStore

        watch = self.watch
        return RunStore(
            folder / "runs",
            device=self.device,
            threads=self.threads,
            on_run=watch.run_done,
            on_frame=watch.frame_done,
        )

    def case(self, case: Place | Case) -> Case:
        """A case with the settings of the call.

        Args:
            case: what `load_case` returns; or a folder, or the name of a case that ships.

        Raises:
            InputError: file, field, value and what is allowed.
        """
        from geometry import case as cases

        if not isinstance(case, cases.Case):
            return cases.load_case(os.fspath(case), self.settings)
        if self.settings is None:
            return case
        return replace(case, config=self.settings, simulation=self.settings.simulation)


@contextmanager
def own_code(effect_files: Files, measurement_files: Files) -> Iterator[None]:
    """Effects and measurement types of somebody's own, for the length of a `with` block."""
    with ExitStack() as stack:
        if effect_files:
            from mpm_taichi.effects import given_effects

            stack.enter_context(given_effects([os.fspath(file) for file in effect_files]))
        if measurement_files:
            from geometry.survey.registry import given_measurements

            stack.enter_context(given_measurements([os.fspath(file) for file in measurement_files]))
        yield
