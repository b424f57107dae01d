"""Effects in words: a table for the documents, paragraphs for a terminal."""

from __future__ import annotations

import re
from collections.abc import Iterable

from mpm_taichi.effects.framework.base import Effect
from pipeline.units import with_signs


def effects_table(effects: Iterable[Effect]) -> str:
    """A Markdown table of effects: what each is, its law, its amplitude, its parameters."""
    rows = ["| effect | because ... | law | amplitude | parameters |", "|---|---|---|---|---|"]
    for one in effects:
        cells = (f"`{one.name}`", one.words, one.equation, _amplitude(one), _parameters(one))
        rows.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    return "\n".join(rows)


def effects_text(effects: Iterable[Effect]) -> str:
    """Effects in plain text, a paragraph each."""
    parts = []
    for one in effects:
        lines = [f"{one.name}: {one.words}", f"  law        {one.equation}"]
        lines.append(f"  amplitude  {_amplitude(one)}")
        lines += [f"  parameter  {_parameter(p)}" for p in one.parameters]
        lines += [f"  looks like {one.looks_like}", f"  source     {one.source}"]
        parts.append("\n".join(lines))
    return "\n\n".join(parts)


def _amplitude(one: Effect) -> str:
    scale = one.amplitude
    unit = f" {with_signs(scale.unit)}" if scale.unit else ""
    steps = ", ".join(f"{value:g}" for value in scale.ladder)
    sign = "±" if scale.two_signed else ""
    return f"{scale.meaning}; {scale.low:g} to {scale.high:g}{unit}; tried at {sign}({steps})"


def _parameters(one: Effect) -> str:
    """Names, defaults, and the first words of each meaning: its symbol in the law."""
    shown = (
        f"`{p.name}` {p.default:g}: {re.split('[,;:(]', p.meaning)[0].rstrip()}"
        for p in one.parameters
    )
    return "; ".join(shown) or "none"


def _parameter(p) -> str:  # noqa: ANN001
    unit = f" {with_signs(p.unit)}" if p.unit else ""
    return f"{p.name} = {p.default:g}{unit} ({p.low:g} to {p.high:g}): {p.meaning}"
