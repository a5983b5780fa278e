"""How kernels are compiled, and where their machine code is kept.

numba's cache is made of pickles, so whoever can write in its folder can run code as the user.
"""

from __future__ import annotations

import hashlib
import os
import stat
import tempfile
import warnings
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import cache, lru_cache
from pathlib import Path
from typing import Any, TypeVar

import numba
import numba.extending
import platformdirs
from numba.core.caching import FunctionCache, IndexDataCacheFile

F = TypeVar("F", bound=Callable[..., Any])

# These three change no bit of a finite result. Contraction, reciprocals and reassociation would:
# then scalar and vector code, and machines with and without FMA, would disagree.
FLAGS = {"nnan", "ninf", "nsz"}

PACKAGE = Path(__file__).resolve().parents[1]


def compiled(function: F) -> F:
    """Compile a kernel with numba, with flags that keep its bits the same on every machine.

    The machine code is cached in a folder named after the sources it was made from, because
    numba's own cache looks at the file of the outermost function alone and would serve stale
    code after an edit of a helper.
    """
    return _kernel(function)


def parallel(function: F) -> F:
    """Compile a kernel as `compiled` does; its loops over `numba.prange` are shared by threads."""
    return _kernel(function, parallel=True)


def piece(function: F) -> F:
    """Compile a part of kernels, for use within `compiled` functions only."""
    part: F = numba.njit(fastmath=FLAGS, error_model="numpy", forceinline=True)(function)
    return part


def shared(function: F) -> F:
    """Let kernels call a plain Python function, which stays one for everybody else."""
    kept: F = numba.extending.register_jitable(function)
    return kept


def _kernel(function: F, **options: Any) -> F:
    source = Path(function.__code__.co_filename).resolve()
    folder = cache_folder(source.parent) if source.exists() else None
    options |= {"fastmath": FLAGS, "error_model": "numpy", "nogil": True}
    kernel: Any = numba.njit(**options)(function)
    if folder is not None:
        # numba asks for the cache folder here; the user's own setting is put back.
        previous = numba.config.CACHE_DIR
        numba.config.CACHE_DIR = folder
        try:
            kernel._cache = _Cache(function)
        finally:
            numba.config.CACHE_DIR = previous
    kept: F = kernel
    return kept


class _CacheFile(IndexDataCacheFile):
    """The files of a kernel; one that is damaged counts as missing, and is written anew."""

    def _load_index(self) -> dict[Any, str]:
        try:
            index: dict[Any, str] = super()._load_index()
            return index
        except Exception as error:  # what is no pickle may raise anything
            _discard(self._index_path, error)
            return {}

    def _load_data(self, name: str) -> Any:
        try:
            return super()._load_data(name)
        except OSError:
            raise  # numba's own way of finding that it is missing
        except Exception as error:
            _discard(self._data_path(name), error)
            return None


class _Cache(FunctionCache):
    """numba's cache of a kernel, which damaged files do not stop."""

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)
        self._cache_file = _CacheFile(
            cache_path=self._cache_path,
            filename_base=self._impl.filename_base,
            source_stamp=self._impl.locator.get_source_stamp(),
        )


def _discard(path: str, error: Exception) -> None:
    warnings.warn(
        f"{path} is damaged ({type(error).__name__}): its kernel is compiled anew", stacklevel=3
    )
    with suppress(OSError):
        os.unlink(path)


@lru_cache
def cache_folder(package: Path) -> str | None:
    """Find a writable folder for machine code made from `usm_gym` and one more package folder.

    `NUMBA_CACHE_DIR` is used where it is set, then the user's cache folder, then a folder of the
    user's in the temporary directory.

    Returns:
        The folder, or None after a warning if there is none: kernels then compile anew in each
        process.
    """
    fingerprint = hashlib.sha256()
    for source in sorted({*PACKAGE.rglob("*.py"), *package.glob("*.py")}):
        fingerprint.update(source.read_bytes())
    for base in _bases():
        folder = base / fingerprint.hexdigest()[:16]
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


def _bases() -> Iterator[Path]:
    """Where there may be a cache, each looked up only if those before it do not serve.

    Not every user has a home, nor every machine a temporary directory. Others write in that one,
    too, so each folder on the way down is checked, from the root on: none can be exchanged once
    those above it have passed. The other two are places that the user trusts.
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
    """Whether it is a folder, not a link to one, in which the user alone can write."""
    found = folder.lstat()
    if _user() is None:
        return stat.S_ISDIR(found.st_mode)
    shared = found.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
    return stat.S_ISDIR(found.st_mode) and found.st_uid == _user() and not shared


def _guarded(folder: Path) -> bool:
    """Whether root and the user alone can exchange what they have put into a folder."""
    if _user() is None:
        return True
    found = folder.lstat()
    shared = found.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
    return (
        stat.S_ISDIR(found.st_mode)
        and found.st_uid in (0, _user())
        and bool(not shared or found.st_mode & stat.S_ISVTX)
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
