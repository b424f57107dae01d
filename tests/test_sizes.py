"""How large the packages and their rooms may become, and which names and formats there may be."""

from __future__ import annotations
