"""Keeps the machine code of kernels.

The folder of a kernel is named after a hash of all that its machine code is made from. numba's own
cache looks only at the kernel's file and would serve stale code after an edit of a helper.

numba's cache consists of pickles, so anyone who can write in its folder can run code as the user.
"""

from __future__ import annotations

import hashlib
import os
import stat
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any

import numba
import numpy as np
import platformdirs
from numba.core.caching import FunctionCache, IndexDataCacheFile

# Packages that have parts of kernels. Functions of others that kernels call are numba's business.
_packages: set[str] = set()
# Every kernel depends on how kernels are compiled and kept.
_HERE = (Path(__file__), Path(__file__).with_name("compile.py"))


def notice(function: Callable[..., Any]) -> None:
    """Remember that the package of a function has parts of kernels."""
    _packages.add(function.__module__.partition(".")[0])


def keep(kernel: Any, function: Callable[..., Any]) -> None:
    """Let a kernel look for its machine code in the folder of its sources, and leave it there."""
    notice(function)
    file = Path(function.__code__.co_filename)
    folder = cache_folder(fingerprint(function)) if file.exists() else None
    if folder is not None:
        # numba asks for the cache folder here; the user's own setting is put back.
        previous = numba.config.CACHE_DIR
        numba.config.CACHE_DIR = folder
        try:
            kernel._cache = _Cache(function)
        finally:
            numba.config.CACHE_DIR = previous


def fingerprint(function: Any) -> str:
    """A hash of all that the machine code of a kernel is made from.

    These are the files of the functions that it calls, directly or not, and the constants that
    these use, wherever they were imported from.
    """
    files, constants = set(_HERE), set()
    known, waiting = {function}, [function]
    while waiting:
        current = waiting.pop()
        files.add(Path(current.__code__.co_filename))
        for name, value in _used(current):
            value = getattr(value, "py_func", value)
            if isinstance(value, FunctionType | type):
                if value.__module__.partition(".")[0] not in _packages:
                    continue
                if isinstance(value, type):  # a named tuple
                    files.add(Path(str(sys.modules[value.__module__].__file__)))
                elif value not in known:
                    known.add(value)
                    waiting.append(value)
            elif isinstance(value, np.ndarray):
                constants.add(f"{name} {value.dtype} {value.shape} {value.tobytes().hex()}")
            elif isinstance(value, bool | int | float | complex | str | tuple):
                constants.add(f"{name} {value!r}")
    parts = [*map(digest, files), *constants]
    return hashlib.sha256("\n".join(sorted(parts)).encode()).hexdigest()


def _used(function: FunctionType) -> Iterator[tuple[str, Any]]:
    """What a function uses, by name: globals, attributes of modules, what it closes over."""
    code = function.__code__
    cells = zip(code.co_freevars, function.__closure__ or (), strict=True)
    yield from ((name, cell.cell_contents) for name, cell in cells)
    names = set(_names(code))
    for name in names & function.__globals__.keys():
        value = function.__globals__[name]
        yield name, value
        if isinstance(value, ModuleType):
            yield from ((other, vars(value)[other]) for other in names & vars(value).keys())


def _names(code: CodeType) -> Iterator[str]:
    """The names in a function's code, and in that of functions within it."""
    yield from code.co_names
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _names(constant)


@cache
def digest(file: Path) -> str:
    """A hash of a file."""
    return hashlib.sha256(file.read_bytes()).hexdigest()


@cache
def cache_folder(name: str) -> str | None:
    """Find a writable folder for machine code that is made from what a fingerprint tells.

    `NUMBA_CACHE_DIR` is used where it is set, then the user's cache folder, then a folder of the
    user's in the temporary directory.

    Returns:
        The folder, or None after a warning if there is none: kernels then compile anew in each
        process.
    """
    for base in _bases():
        folder = base / name[:16]
        try:
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            if not _owned(folder):
                continue
            with tempfile.TemporaryFile(dir=folder):
                return str(folder)
        except OSError:
            continue
    _warn_of_no_cache()
    return None


class _CacheFile(IndexDataCacheFile):
    """The files of a kernel; a damaged one counts as missing and is written again."""

    def _load_index(self) -> dict[Any, str]:
        try:
            index: dict[Any, str] = super()._load_index()
            return index
        except (AttributeError, ImportError):
            return {}  # of a version in which the type of an argument stood elsewhere
        except Exception as error:  # a damaged pickle may raise anything
            _discard(self._index_path, error)
            return {}

    def _load_data(self, name: str) -> Any:
        try:
            return super()._load_data(name)
        except OSError:
            raise  # numba's own sign that it is missing
        except Exception as error:
            _discard(self._data_path(name), error)
            return None


class _Cache(FunctionCache):
    """numba's cache of a kernel, which survives damaged files."""

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)
        self._cache_file = _CacheFile(
            cache_path=self._cache_path,
            filename_base=self._impl.filename_base,
            source_stamp=self._impl.locator.get_source_stamp(),
        )

    def _index_key(self, sig: Any, codegen: Any) -> tuple[Any, ...]:
        """Tell named tuples apart by their fields, too: kernels may not import their modules."""
        return (*super()._index_key(sig, codegen), *map(_fields, sig))


def _fields(kind: Any) -> tuple[Any, ...]:
    """Names of the fields of an argument's type, and of the types within it."""
    return (*getattr(kind, "fields", ()), *map(_fields, getattr(kind, "types", ())))


def _discard(path: str, error: Exception) -> None:
    warnings.warn(
        f"{path} is damaged ({type(error).__name__}): its kernel is compiled anew", stacklevel=3
    )
    with suppress(OSError):
        os.unlink(path)


def _bases() -> Iterator[Path]:
    """Possible places of a cache; a place is looked up only if those before it cannot be used.

    Not every user has a home, and not every machine a temporary directory. Others can write in the
    temporary directory, so all folders on the way to it are checked from the root down: nobody can
    exchange a folder once those above it have passed. The user trusts the other two places.
    """
    if numba.config.CACHE_DIR:
        yield Path(numba.config.CACHE_DIR)
    with suppress(RuntimeError):
        home = platformdirs.user_cache_path("usm-gym")
        if home.is_absolute():  # some versions return "~" where there is no home
            yield home
    with suppress(OSError):
        shared = Path(tempfile.gettempdir()).resolve() / f"usm-gym-{_user()}"
        shared.mkdir(mode=0o700, exist_ok=True)
        if all(_guarded(folder) for folder in (*reversed(shared.parents), shared)):
            yield shared


def _owned(folder: Path) -> bool:
    """Whether it is a folder, not a link to one, in which only the user can write."""
    status = folder.lstat()
    if _user() is None:
        return stat.S_ISDIR(status.st_mode)
    shared = status.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
    return stat.S_ISDIR(status.st_mode) and status.st_uid == _user() and not shared


def _guarded(folder: Path) -> bool:
    """Whether only root and the user can exchange what they have put into a folder."""
    if _user() is None:
        return True
    status = folder.lstat()
    shared = status.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
    return (
        stat.S_ISDIR(status.st_mode)
        and status.st_uid in (0, _user())
        and bool(not shared or status.st_mode & stat.S_ISVTX)
    )


@cache
def _warn_of_no_cache() -> None:
    warnings.warn(
        "no safe and writable cache folder: kernels are compiled anew in every process; "
        "set NUMBA_CACHE_DIR to a folder of your own",
        stacklevel=2,
    )


def _user() -> int | None:
    """The user's number, where the system has them."""
    return os.getuid() if hasattr(os, "getuid") else None
