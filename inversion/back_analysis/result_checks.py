"""Whether the parts of a result fit together: what tables and pictures look up must be there.

In: a `Result`, each part of its form. Out: nothing, or a ValueError that names the field.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from inversion.engines.registry import engines

if TYPE_CHECKING:
    from inversion.back_analysis.result import Result

METHOD_KEYS = ("title", "value_kpa", "low_kpa", "high_kpa")
"""Keys of a classical method that are shown."""


def check_whole(result: Result) -> None:
    """Refuse a result without an answer, or whose parts name other parameters.

    Raises:
        ValueError: the field and what is wrong with it.
    """
    names = [parameter.name for parameter in result.answer.parameters]
    for field, entries in (
        ("answer.parameters", names),
        ("iterations", result.iterations),
        ("measurements", result.measurements),
        *((f"sensitivities.{n}.sides", one.sides) for n, one in enumerate(result.sensitivities)),
        *(
            (f"answer.undetermined.{n}.direction", one.direction)
            for n, one in enumerate(result.answer.undetermined)
        ),
    ):
        if not entries:
            raise ValueError(f"{field}: is empty")
    asked = {spec.name for spec in result.question.parameters}
    for name in names:
        if name not in asked:
            raise ValueError(f"answer.parameters: {name} is not a parameter of the question")
    for field, values in _by_parameter(result):
        for name in names:
            if name not in values:
                raise ValueError(f"{field}: {name} is missing")
    _check_correlation(result, len(names))
    for field, engine in (
        ("engine", result.engine),
        *((f"engines.{number}.engine", one.engine) for number, one in enumerate(result.engines)),
    ):
        if engine not in engines():
            raise ValueError(f"{field}: {engine!r}; allowed are {', '.join(engines())}")
    check_classical(result.classical)
    for name, entry in result.published.items():
        _check_range(f"published.{name}", [entry.get(key) for key in ("value", "low", "high")])


def check_classical(analyses: Sequence[Any]) -> None:
    """Refuse analyses of the classical methods of which nothing can be shown.

    Raises:
        ValueError: the field and what is wrong with it.
    """
    for number, analysis in enumerate(analyses):
        where = f"classical.{number}"
        methods = analysis.get("methods") if isinstance(analysis, Mapping) else None
        if not isinstance(methods, list) or not isinstance(analysis.get("name"), str):
            raise ValueError(f"{where}: needs a name and a list of methods")
        for place, method in enumerate(methods):
            if not isinstance(method, Mapping):
                raise ValueError(f"{where}.methods.{place}: is not a mapping")
            for key in METHOD_KEYS:
                if key not in method:
                    raise ValueError(f"{where}.methods.{place}.{key}: is missing")
            _check_range(f"{where}.methods.{place}", [method[key] for key in METHOD_KEYS[1:]])


def _by_parameter(result: Result) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Fields that have a value for every parameter."""
    for number, look in enumerate(result.iterations):
        yield f"iterations.{number}.values", look.values
    for number, start in enumerate(result.starts):
        yield f"starts.{number}.start", start.start
        yield f"starts.{number}.answer", start.answer
    for number, variant in enumerate(result.variants):
        yield f"variants.{number}.values", variant.values
    for number, entry in enumerate(result.sensitivities):
        yield f"sensitivities.{number}.std", entry.std
        for place, side in enumerate(entry.sides):
            yield f"sensitivities.{number}.sides.{place}.change", side.change
    for number, stop in enumerate(result.answer.equally_good):
        yield f"answer.equally_good.{number}.values", stop.values
    for number, row in enumerate(result.engines):
        yield f"engines.{number}.values", row.values
    if result.noise is not None:
        yield "noise.answer_std", result.noise.answer_std


def _check_correlation(result: Result, n: int) -> None:
    correlation = result.answer.correlation
    sizes = [len(correlation.matrix), *map(len, correlation.matrix)]
    if len(correlation.names) != n or any(size != n for size in sizes):
        raise ValueError(f"answer.correlation: must be {n} by {n}, as there are parameters")


def _check_range(where: str, numbers: Sequence[Any]) -> None:
    """A value with its lower and its upper end, each a number or None."""
    if not all(one is None or type(one) in (int, float) for one in numbers):
        raise ValueError(f"{where}: numbers or null are wanted, in kPa")
    if (numbers[1] is None) != (numbers[2] is None):
        raise ValueError(f"{where}: the lower and the upper end: give both or neither")
