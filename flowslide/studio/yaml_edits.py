"""A YAML file with other content and its own comments.

A case's files say in comments where their numbers come from. The page sends plain documents; what
they change is put into the file's text, and the rest of it stays as somebody wrote it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from io import StringIO
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap, CommentedSeq
from ruamel.yaml.error import YAMLError
from ruamel.yaml.tokens import CommentToken

from pipeline.cli import InputError
from pipeline.files import parse_yaml, yaml_text

WIDTH = 120


def edited_yaml(text: str, document: Mapping[str, Any]) -> str:
    """The text of a YAML file with other content; comments stay with what they are about.

    Args:
        text: of the file as it is; may be empty.
        document: the content that is wanted: plain values, lists and mappings.
    """
    yaml = YAML()
    yaml.width = WIDTH
    yaml.preserve_quotes = True
    yaml.indent(mapping=2, sequence=4, offset=2)
    yaml.representer.add_representer(type(None), _null)
    out = StringIO()
    try:
        tree = yaml.load(text)
        _put(tree, document)
        yaml.dump(tree, out)
        if parse_yaml(out.getvalue(), name="edited file") == document:
            return out.getvalue()
    except (YAMLError, InputError, LookupError, TypeError, ValueError, AttributeError):
        pass
    # Comments are worth less than the right content.
    return yaml_text(dict(document), width=WIDTH, default_flow_style=None)


def _null(representer: Any, _: None) -> Any:
    return representer.represent_scalar("tag:yaml.org,2002:null", "null")


def _put(tree: Any, wanted: Any) -> None:
    """Make a mapping or list of the file equal to what is wanted, entry by entry."""
    if isinstance(wanted, Mapping):
        for key in [key for key in tree if key not in wanted]:
            _drop(tree, key)
        keys: Iterable[Any] = wanted.keys()
    else:
        _sort_by_name(tree, wanted)
        del tree[len(wanted) :]
        keys = range(len(wanted))
    for key in keys:
        value = wanted[key]
        known = key in tree if isinstance(wanted, Mapping) else key < len(tree)
        kept = tree[key] if known else None
        if _alike(kept, value):
            _put(kept, value)
        elif not known and isinstance(wanted, list):
            tree.append(_fresh(value))
        elif not known or kept != value or type(kept) is bool or type(value) is bool:
            tree[key] = _fresh(value)


def _drop(tree: CommentedMap, key: Any) -> None:
    """Take a key away, but not the comment below it, which is about what comes next."""
    names = list(tree)
    before = names[names.index(key) - 1] if names[0] != key else None
    below = (tree.ca.items.get(key) or [None] * 4)[2]
    del tree[key]
    if below is None or before is None or "\n" not in below.value[:-1]:
        return
    places = tree.ca.items.setdefault(before, [None] * 4)
    if places[2] is None:
        lines = below.value[below.value.index("\n") :]
        places[2] = CommentToken(lines, below.start_mark, None)


def _alike(kept: Any, value: Any) -> bool:
    return (isinstance(kept, CommentedMap) and isinstance(value, Mapping)) or (
        isinstance(kept, CommentedSeq) and isinstance(value, list)
    )


def _sort_by_name(tree: Any, wanted: list[Any]) -> None:
    """Bring entries with a name into the order that is wanted; those without a place go last."""
    names = [one.get("name") if isinstance(one, Mapping) else None for one in wanted]
    if None in names or len(tree) == 0:
        return
    by_name: dict[Any, Any] = {one.get("name"): one for one in tree if isinstance(one, Mapping)}
    if [one.get("name") if isinstance(one, Mapping) else None for one in tree] == names:
        return
    ordered = [by_name.pop(name, None) or CommentedMap(name=name) for name in names]
    tree[:] = ordered


def _fresh(value: Any) -> Any:
    """A value as this project writes it: lists of numbers and points on one line."""
    if isinstance(value, Mapping):
        found = CommentedMap((key, _fresh(inner)) for key, inner in value.items())
        if not any(isinstance(inner, Mapping | list) for inner in value.values()):
            found.fa.set_flow_style()
        return found
    if isinstance(value, list):
        entries = CommentedSeq(_fresh(inner) for inner in value)
        if not any(isinstance(inner, Mapping) for inner in value):
            entries.fa.set_flow_style()
        return entries
    return value
