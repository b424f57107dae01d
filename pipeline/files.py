"""Files that are whole or absent, and YAML and JSON that is checked while it is read.

A file is written next to its place under a hidden temporary name, flushed to the disk and renamed.
A killed process leaves the old file or none; what a SIGKILL leaves of the temporary file is swept
up by the next write to the same place.
"""

from __future__ import annotations

import errno
import fcntl
import hashlib
import itertools
import json
import math
import os
import re
import socket
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import yaml
from yaml.composer import Composer
from yaml.constructor import SafeConstructor
from yaml.parser import Parser
from yaml.reader import Reader
from yaml.resolver import Resolver
from yaml.scanner import Scanner

from pipeline.cli import InputError, WorkFailed

_HASH_LENGTH = 16
_MOST_NESTED = 100
"""Lists and mappings within one another; documents of ours have a tenth of it."""
_TOO_DEEP = f"lists and mappings are nested more than {_MOST_NESTED} deep"
_MOST_DIGITS = 300
"""Of an integer; a float ends at 308."""
_MOST_VALUES = 100_000
"""Of a YAML document, those that its aliases (`*name`) repeat counted each time; documents of ours
have some hundreds. So many take some seconds to read."""
MOST_CHARACTERS = 50_000_000
"""Of a text file."""
_counter = itertools.count()


@contextmanager
def atomic_path(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield a temporary path to write to; on success it becomes `path`, on failure it is removed.

    The temporary file lies in the same folder (made if missing) and keeps the suffix, since many
    writers choose the format by it.

    Raises:
        InputError: the folder cannot be made, or nothing may be written there.
        OSError: naming `path`: it cannot be written, or not to its end.
    """
    final = Path(path)
    if not final.name:
        raise InputError(f"{str(path)!r}: names no file")
    make_folder(final.parent)
    _sweep_leftovers(final)
    owner = f"{socket.gethostname()}-{os.getpid()}-{next(_counter)}"
    temporary = final.with_name(f".{final.stem}.{owner}.tmp{final.suffix}")
    try:
        yield temporary
        _flush_to_disk(temporary)
        try:
            os.replace(temporary, final)
        except IsADirectoryError:
            raise InputError(f"{final}: is a folder; a file is to be written there") from None
        _flush_to_disk(final.parent)
    except OSError as error:
        # A full disk names no file, a name that is too long the temporary one.
        if error.errno is None or error.filename not in (None, str(temporary), temporary):
            raise
        raise OSError(error.errno, os.strerror(error.errno), str(final)) from error
    finally:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)


def make_folder(path: str | os.PathLike[str]) -> Path:
    """Make a folder and those above it, if missing.

    Raises:
        InputError: it cannot be made, or nothing may be written there.
    """
    folder = Path(path)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if not os.access(folder, os.W_OK | os.X_OK):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
    except OSError as error:
        raise InputError(f"{folder}: cannot be written: {error.strerror}") from None
    return folder


@contextmanager
def only_one(folder: str | os.PathLike[str], words: str, name: str = "lock") -> Iterator[None]:
    """Refuse a second process on a folder, which is made if missing; held as long as this lasts.

    A job may be queued again while the first still runs. On a file system without locks nobody is
    refused: atomic files still keep every part whole.

    Args:
        folder: of the work.
        words: that say what the other process does.
        name: of the file that is locked.

    Raises:
        WorkFailed: another process holds it.
        InputError: the folder cannot be made, or nothing can be written there.
    """
    path = make_folder(folder) / name
    while True:
        try:
            lock = path.open("a")  # not "w": what a link leads to would be emptied
        except OSError as error:
            raise InputError(f"{folder}: cannot be written: {error.strerror}") from None
        with lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise WorkFailed(words) from None
            except OSError:
                pass
            if path.exists() and os.path.samestat(os.fstat(lock.fileno()), path.stat()):
                yield
                return
            # Whoever held it has just ended and removed it.


@contextmanager
def working_in(folder: str | os.PathLike[str]) -> Iterator[None]:
    """Have a folder of results to oneself; entered once the input is known to be good.

    It is made if missing, and goes again where nothing came to lie in it.

    Raises:
        WorkFailed: another command works in it.
        InputError: nothing can be written there.
    """
    folder, words = Path(folder), "wait for it, end it, or choose another (--out)"
    there = folder.exists()
    with only_one(folder, f"{folder}: another command works in this folder: {words}", ".lock"):
        try:
            yield
        finally:
            (folder / ".lock").unlink(missing_ok=True)
            if not there:
                with suppress(OSError):  # it has files
                    folder.rmdir()


def write_text(path: str | os.PathLike[str], text: str) -> None:
    """Write `text` as UTF-8, atomically."""
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")


def write_json(path: str | os.PathLike[str], value: Any) -> None:
    """Write `value` as indented JSON, atomically. NaN and infinity are refused."""
    write_text(path, json.dumps(value, indent=2, allow_nan=False, default=_plain) + "\n")


def file_or_within(path: str | os.PathLike[str], name: str) -> Path:
    """The path of a file that is named itself, or by the folder that has it under `name`."""
    path = Path(path)
    return path / name if path.is_dir() else path


def read_json(path: str | os.PathLike[str]) -> Any:
    """Read a JSON file; a missing file, bad syntax, a repeated key or NaN is an `InputError`."""
    text = read_text(path)
    try:
        return _not_too_deep(
            json.loads(
                text,
                object_pairs_hook=_refuse_repeated_keys,
                parse_constant=_refuse_constant,
                parse_float=_finite_float,
                parse_int=_finite_int,
            )
        )
    except json.JSONDecodeError as error:
        raise InputError(f"{path}: line {error.lineno}: not valid JSON: {error.msg}") from None
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    except RecursionError:
        raise InputError(f"{path}: {_TOO_DEEP}") from None


def read_yaml(path: str | os.PathLike[str]) -> Any:
    """Read a YAML file; a missing file, bad syntax, a repeated key or NaN is an `InputError`."""
    return parse_yaml(read_text(path), name=str(path))


def parse_yaml(text: str, *, name: str) -> Any:
    """Read YAML from a string; `name` stands for it in messages."""
    try:
        return _not_too_deep(yaml.load(text, Loader=_CheckedLoader))
    except yaml.MarkedYAMLError as error:
        line = f"line {error.problem_mark.line + 1}: " if error.problem_mark else ""
        raise InputError(f"{name}: {line}not valid YAML: {error.problem or error}") from None
    except yaml.YAMLError as error:
        raise InputError(f"{name}: not valid YAML: {error}") from None
    except InputError as error:
        raise InputError(f"{name}: {error}") from None
    except RecursionError:
        raise InputError(f"{name}: {_TOO_DEEP}") from None
    except (ValueError, OverflowError) as error:
        raise InputError(f"{name}: not valid YAML: {error}") from None
    except (LookupError, TypeError, AttributeError):  # PyYAML on `!!bool maybe` and the like
        raise InputError(f"{name}: not valid YAML: a value does not fit its tag (!!)") from None


def file_hash(path: str | os.PathLike[str]) -> str:
    """SHA-256 (hex) of a file's bytes."""
    with Path(path).open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def content_hash(value: Any) -> str:
    """16 hexadecimal digits of the SHA-256 of `value` as canonical JSON."""
    text = json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False, default=_plain)
    return hashlib.sha256(text.encode()).hexdigest()[:_HASH_LENGTH]


def _plain(value: Any) -> Any:
    """Turn a pydantic model, a numpy value or a path into what JSON knows."""
    if hasattr(value, "model_dump"):
        return value.model_dump(mode="json")
    if hasattr(value, "tolist"):
        return value.tolist()
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    raise TypeError(f"{type(value).__name__} has no JSON form")


def _flush_to_disk(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _sweep_leftovers(final: Path) -> None:
    """Remove temporary files of `final` whose process, on this machine, has ended."""
    host = re.escape(socket.gethostname())
    pattern = re.compile(
        rf"\.{re.escape(final.stem)}\.{host}-(\d+)-\d+\.tmp{re.escape(final.suffix)}"
    )
    for entry in final.parent.iterdir():
        match = pattern.fullmatch(entry.name)
        if match and not _is_alive(int(match.group(1))):
            entry.unlink(missing_ok=True)


def _is_alive(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True


def _refuse_repeated_keys(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    result: dict[str, Any] = {}
    for key, value in pairs:
        if key in result:
            raise InputError(f"the key {key!r} is given twice")
        result[key] = value
    return result


def _refuse_constant(text: str) -> float:
    raise InputError(f"{text} is not a number that can be used: every number must be finite")


def _finite_float(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        _refuse_constant(text)
    return value


def _finite_int(text: str) -> int:
    # Python refuses to read integers of thousands of digits, and float() those of hundreds.
    digits = len(text.lstrip("+-").lstrip("0"))
    if digits > _MOST_DIGITS:
        raise InputError(f"an integer of {digits} digits: at most {_MOST_DIGITS} can be used")
    return int(text)


def _not_too_deep(value: Any) -> Any:
    """The value; nesting that later steps could not follow, or within itself, is refused."""
    layer: list[dict[Any, Any] | list[Any]] = [[value]]
    for _ in range(_MOST_NESTED + 1):
        inner = (
            item
            for outer in layer
            for item in (outer.values() if isinstance(outer, dict) else outer)
            if isinstance(item, dict | list)
        )
        layer = list({id(item): item for item in inner}.values())  # what has two aliases: once
        if not layer:
            return value
    raise InputError(_TOO_DEEP)


class _PythonEvents(Reader, Scanner, Parser):
    """Where PyYAML was built without libyaml."""

    def __init__(self, text: str) -> None:
        Reader.__init__(self, text)
        Scanner.__init__(self)
        Parser.__init__(self)


#: What a text consists of; libyaml reads it in a fifth of the time.
_Events: Any = (
    yaml.cyaml.CParser if yaml.__with_libyaml__ else _PythonEvents  # type: ignore[attr-defined]
)


class _CheckedLoader(Composer, SafeConstructor, Resolver, _Events):
    """Plain values of YAML 1.2, unlike PyYAML's 1.1: 1e-5 is a number and `no` is a word."""

    yaml_implicit_resolvers: dict[str, list] = {}

    def __init__(self, text: str) -> None:
        _Events.__init__(self, text)
        Composer.__init__(self)
        SafeConstructor.__init__(self)
        Resolver.__init__(self)
        self._values = 0
        self._size: dict[int, int] = {}

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        """A node; ten lines of aliases of aliases may stand for more than a memory holds."""
        before, event = self._values, self.peek_event()
        repeated = isinstance(event, yaml.AliasEvent)
        node = super().compose_node(parent, index)
        self._values += self._size.get(id(node), 1) if repeated else 1
        if self._values > _MOST_VALUES:
            line = event.start_mark.line + 1
            raise InputError(
                f"line {line}: more than {_MOST_VALUES:,} values, the most that is read"
            )
        if not repeated:
            self._size[id(node)] = self._values - before
        return node

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict:
        seen = set()
        for key_node, _ in node.value:
            if key_node.tag == "tag:yaml.org,2002:merge":
                continue
            key = self.construct_object(key_node, deep=True)
            if not isinstance(key, str):
                raise InputError(
                    f"line {key_node.start_mark.line + 1}: the key {key!r} is not text: quote it"
                )
            if key in seen:
                line = key_node.start_mark.line + 1
                raise InputError(f"line {line}: the key {key!r} is given twice")
            seen.add(key)
        return super().construct_mapping(node, deep)

    def construct_finite_float(self, node: yaml.ScalarNode) -> float:
        value = self.construct_yaml_float(node)
        if not math.isfinite(value):
            raise InputError(
                f"line {node.start_mark.line + 1}: {node.value} is not a number that can be used: "
                "every number must be finite"
            )
        return value

    def construct_decimal(self, node: yaml.ScalarNode) -> int:
        try:
            return _finite_int(node.value)
        except InputError as error:
            raise InputError(f"line {node.start_mark.line + 1}: {error}") from None


class _QuotingDumper(yaml.CSafeDumper if yaml.__with_libyaml__ else yaml.SafeDumper):  # type: ignore[misc]
    """Writes what `_CheckedLoader` reads: text that looks like a number of YAML 1.2 is quoted."""


def yaml_text(document: object, **options: Any) -> str:
    """A document as YAML text that `read_yaml` reads as the same document.

    PyYAML alone leaves a hash such as 80601e8423623564 unquoted, which YAML 1.2 takes for a number.

    Args:
        document: plain values, lists and mappings.
        options: of `yaml.dump`.
    """
    return yaml.dump(document, Dumper=_QuotingDumper, sort_keys=False, **options)


_CheckedLoader.add_constructor("tag:yaml.org,2002:float", _CheckedLoader.construct_finite_float)
_CheckedLoader.add_constructor("tag:yaml.org,2002:int", _CheckedLoader.construct_decimal)
for _tag, _pattern, _first in (
    ("null", r"~|null|Null|NULL|", [*"~nN", ""]),
    ("bool", r"true|True|TRUE|false|False|FALSE", [*"tTfF"]),
    ("int", r"[-+]?[0-9]+", [*"-+0123456789"]),
    (
        "float",
        r"[-+]?(\.[0-9]+|[0-9]+\.[0-9]*|[0-9]+(?=[eE]))([eE][-+]?[0-9]+)?"
        r"|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)",
        [*"-+.0123456789"],
    ),
    ("merge", r"<<", ["<"]),
):
    for _side in (_CheckedLoader, _QuotingDumper):
        _side.add_implicit_resolver(
            f"tag:yaml.org,2002:{_tag}", re.compile(rf"(?:{_pattern})\Z"), _first
        )


def read_text(path: str | os.PathLike[str], *, encoding: str = "utf-8") -> str:
    """The text of a file.

    Args:
        path: of the file.
        encoding: "utf-8", or "utf-8-sig" where a spreadsheet may have put a mark in front.

    Raises:
        InputError: no such file, one that cannot be read, no text, or too much of it: one line.
    """
    try:
        with Path(path).open(encoding=encoding) as file:
            text = file.read(MOST_CHARACTERS + 1)
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except UnicodeDecodeError:
        raise InputError(f"{path}: not a UTF-8 text file") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None
    if len(text) > MOST_CHARACTERS:
        raise InputError(f"{path}: more than {MOST_CHARACTERS / 1e6:.0f} MB of text")
    return text


def ready_folder(path: str | os.PathLike[str], names: Iterable[str]) -> Path:
    """Make a folder in which files of these names can be written.

    Raises:
        InputError: it cannot be made or written, or a folder lies where a file is to be.
    """
    folder = make_folder(path)
    for name in names:
        if (folder / name).is_dir():
            raise InputError(f"{folder / name}: is a folder; a file is to be written there")
    return folder
