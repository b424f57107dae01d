"""How large the packages and their rooms may become, and which names and formats there may be."""

from __future__ import annotations

import ast
from collections import defaultdict
from pathlib import Path

import pytest

from tests.test_layout import FILES, PRESENT, ROOT, relative, tree_of
