"""Where a number of a case comes from: the comment that stands by it in its file.

In: a YAML file and the way to an entry. Out: the comment behind the entry, or on the lines right
above it; empty where nobody wrote one.
"""

from __future__ import annotations

import re
from pathlib import Path

import yaml

COMMENT = re.compile(r"\s*#\s?(.*)")


class Comments:
    """The comments of a file.

    Args:
        path: of the file; it may be missing.
    """

    def __init__(self, path: Path) -> None:
        text = path.read_text("utf-8") if path.is_file() else ""
        self._root, self._lines = yaml.compose(text, yaml.SafeLoader), text.splitlines()

    def on(self, *keys: str) -> str:
        """The comment on an entry.

        Args:
            keys: the way to it: keys of mappings, and the `name` of an entry of a list.
        """
        key, value = None, self._root
        for wanted in keys:
            key, value = _entry(value, wanted)
            if value is None:
                return ""
        end = value.end_mark
        # The value of a block ends where the next entry begins: a comment there is not its own.
        behind = self._lines[end.line][end.column :] if end.line < len(self._lines) else ""
        found = COMMENT.fullmatch(behind) if end.column else None
        if found is not None:
            return found[1].strip()
        above = []
        for line in reversed(self._lines[: key.start_mark.line]):
            found = COMMENT.fullmatch(line)
            if found is None:
                break
            above.insert(0, found[1].strip())
        return " ".join(above)


def _entry(node: yaml.Node | None, wanted: str) -> tuple[yaml.Node | None, yaml.Node | None]:
    """The key and the value of an entry of a mapping, or of a list by its name."""
    if isinstance(node, yaml.MappingNode):
        return next(((k, v) for k, v in node.value if k.value == wanted), (None, None))
    for entry in node.value if isinstance(node, yaml.SequenceNode) else []:
        if isinstance(entry, yaml.MappingNode) and wanted == _name(entry):
            return entry, entry
    return None, None


def _name(entry: yaml.MappingNode) -> str:
    return next((v.value for k, v in entry.value if k.value == "name"), "")
