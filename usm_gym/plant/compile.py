"""How kernels are compiled, and where their machine code is kept."""

from __future__ import annotations

import hashlib
import os
import tempfile
import warnings
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar

import numba
import numba.extending
import platformdirs

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
    options |= {
        "fastmath": FLAGS,
        "error_model": "numpy",
        "nogil": True,
        "cache": folder is not None,
    }
    # numba chooses the cache folder while it decorates; the user's own setting is put back.
    previous = numba.config.CACHE_DIR
    numba.config.CACHE_DIR = folder or previous
    try:
        kernel: F = numba.njit(**options)(function)
    finally:
        numba.config.CACHE_DIR = previous
    return kernel


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
    bases = [
        Path(numba.config.CACHE_DIR) if numba.config.CACHE_DIR else None,
        platformdirs.user_cache_path("usm-gym"),
        Path(tempfile.gettempdir()) / f"usm-gym-{_user()}",
    ]
    for base in filter(None, bases):
        folder = base / fingerprint.hexdigest()[:16]
        try:
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            if folder.stat().st_uid != _user():
                continue  # what is loaded from there is run: never from somebody else's folder
            with tempfile.TemporaryFile(dir=folder):
                return str(folder)
        except OSError:
            continue
    warnings.warn(
        "no writable cache folder: kernels are compiled anew in every process; "
        "set NUMBA_CACHE_DIR to a writable folder",
        stacklevel=2,
    )
    return None


def _user() -> int:
    return os.getuid() if hasattr(os, "getuid") else 0
