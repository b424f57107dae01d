"""What the size of the cells makes of strengths, in words."""

from __future__ import annotations

from typing import Any

from inversion.engines.small_cells import SmallCells


def cells_words(cells: SmallCells) -> str:
    """What the size of the cells makes of strengths, as a sentence."""
    if not cells.known:
        return (
            f"{cells.words[0].upper()}{cells.words[1:]}. The strengths are as the runs have them, "
            f"and less certain by {100 * cells.log_std:.0f} %."
        )
    return (
        f"Strengths are those in small cells: {cells.factor:.3f} ± {cells.log_std:.3f} times what "
        f"the runs take, from runs with points {cells.spacing_m:g} and "
        f"{cells.other_spacing_m:g} m apart."
    )


def cells_of(document: dict[str, Any]) -> list[str]:
    """The same of a prediction; empty: it does not say."""
    cells = document.get("small_cells")
    return [cells_words(SmallCells.model_validate(cells))] if cells else []
