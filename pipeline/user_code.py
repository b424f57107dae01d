"""Python files of users, which add to a library: they are code, and are run only when named."""

from __future__ import annotations

import hashlib
import importlib.util
import sys
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import ModuleType

from pipeline.cli import InputError


def load_user_code(path: str | Path, kind: str) -> tuple[ModuleType, str]:
    """Run a Python file as a module; the same content is run once.

    Args:
        path: of the file.
        kind: beginning of the module's name.

    Returns:
        the module, and the hash of the file.

    Raises:
        InputError: no such file, no Python file, or an error in it; one line.
    """
    path = Path(path)
    try:
        text = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or error}") from None
    version = hashlib.sha256(text).hexdigest()[:16]
    if path.suffix != ".py":
        raise InputError(f"{path}: is not a Python file (.py)")
    name = f"_{kind}_{version}"
    if name in sys.modules:
        return sys.modules[name], version
    loader = SourceFileLoader(name, str(path))
    spec = importlib.util.spec_from_loader(name, loader)
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    try:
        loader.exec_module(module)
    except (Exception, SystemExit) as error:
        del sys.modules[name]
        words = " ".join(str(error).split())
        raise InputError(f"{path}: does not load: {type(error).__name__}: {words}") from None
    return module, version
