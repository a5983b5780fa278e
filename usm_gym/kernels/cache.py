"""Keeps the machine code of kernels.

The folder of a kernel is named after a hash of its sources: the file of the kernel and the files of
all modules that it imports, directly or not. numba's own cache looks only at the kernel's file and
would serve stale code after an edit of a helper.

numba's cache consists of pickles, so anyone who can write in its folder can run code as the user.
"""

from __future__ import annotations

import hashlib
import os
import re
import stat
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import cache
from importlib.util import resolve_name
from pathlib import Path
from typing import Any

import numba
import platformdirs
from numba.core.caching import FunctionCache, IndexDataCacheFile

# The imports at the top of a module: what is imported, or from where which names.
IMPORT = re.compile(
    r"^(?:import +([\w.]+)|from +([\w.]+) +import +(?:\(([^)]*)\)|([^#\n]+)))", re.MULTILINE
)
# Packages that have kernels or parts of them: an edit in one of them matters to what imports it.
_packages: set[str] = set()


def notice(function: Callable[..., Any]) -> None:
    """Remember that the package of a function has parts of kernels."""
    _packages.add(function.__module__.partition(".")[0])


def keep(kernel: Any, function: Callable[..., Any]) -> None:
    """Let a kernel look for its machine code in the folder of its sources, and leave it there."""
    notice(function)
    file = Path(function.__code__.co_filename).resolve()
    folder = cache_folder(sources(file, function.__module__)) if file.exists() else None
    if folder is not None:
        # numba asks for the cache folder here; the user's own setting is put back.
        previous = numba.config.CACHE_DIR
        numba.config.CACHE_DIR = folder
        try:
            kernel._cache = _Cache(function)
        finally:
            numba.config.CACHE_DIR = previous


def sources(file: Path, module: str) -> frozenset[Path]:
    """The files of a module and of all our modules that it imports, directly or not.

    Ours are the modules of packages that have kernels, and those in the folder of the file.
    """
    files, waiting = {file}, [(file, module)]
    while waiting:
        for name, imported in imports(*waiting.pop()):
            ours = name.partition(".")[0] in _packages or imported.parent == file.parent
            if ours and imported not in files:
                files.add(imported)
                waiting.append((imported, name))
    return frozenset(files)


@cache
def imports(file: Path, module: str) -> tuple[tuple[str, Path], ...]:
    """Names and files of the modules that the top of a module imports.

    Of `from package import name`, this is the module `package.name` if there is one, else `package`
    itself: importing a module of a package does not depend on everything that the package imports.
    """
    package = module if file.name == "__init__.py" else module.rpartition(".")[0]
    names: set[str] = set()
    for whole, origin, inside, line in IMPORT.findall(file.read_text(encoding="utf-8")):
        if origin:
            origin = resolve_name(origin, package or None)
        listed = [word.split(" as ")[0].strip() for word in (inside or line).split(",")]
        parts = {f"{origin}.{word}" for word in listed if word}
        names |= {name if name in sys.modules else origin for name in parts} | {whole}
    files = ((name, getattr(sys.modules.get(name), "__file__", None)) for name in sorted(names))
    return tuple((name, Path(known).resolve()) for name, known in files if known is not None)


@cache
def digest(file: Path) -> str:
    """A hash of a file."""
    return hashlib.sha256(file.read_bytes()).hexdigest()


@cache
def cache_folder(files: frozenset[Path]) -> str | None:
    """Find a writable folder for machine code that is made from some files.

    The first choice is `NUMBA_CACHE_DIR`, if it is set, then the user's cache folder, then a folder
    in the temporary directory.

    Returns:
        The folder, or None after a warning: kernels are then compiled again in every process.
    """
    fingerprint = hashlib.sha256(" ".join(sorted(map(digest, files))).encode()).hexdigest()
    for base in _bases():
        folder = base / fingerprint[:16]
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
