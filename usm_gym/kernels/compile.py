"""How kernels are compiled."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numba
import numba.extending

from usm_gym.kernels.cache import keep, notice

F = TypeVar("F", bound=Callable[..., Any])

# These three change no bit of a finite result. Contraction, reciprocals and reassociation would:
# then scalar and vector code, and machines with and without FMA, would disagree.
FLAGS = {"nnan", "ninf", "nsz"}


def compiled(function: F) -> F:
    """Compile a kernel with numba, with flags that keep its bits the same on every machine.

    Its machine code is cached (`usm_gym.kernels.cache`).
    """
    return _kernel(function)


def watchful(function: F) -> F:
    """Compile a kernel as `compiled` does, but for numbers that may be infinite or none at all."""
    return _kernel(function, fastmath=False)


def parallel(function: F) -> F:
    """Compile a kernel as `compiled` does; its loops over `numba.prange` are shared by threads."""
    return _kernel(function, parallel=True)


def piece(function: F) -> F:
    """Compile a part of kernels, for use within `compiled` functions only."""
    return _part(function, forceinline=True)


def aside(function: F) -> F:
    """Compile a part of kernels that is seldom run: it is called, where a `piece` is inlined."""
    return _part(function)


def shared(function: F) -> F:
    """Let kernels call a plain Python function, which stays one for everybody else."""
    notice(function)
    kept: F = numba.extending.register_jitable(function)
    return kept


def _part(function: F, **options: Any) -> F:
    notice(function)
    # No C code calls it, and an entry for that takes long to compile.
    usual = {"fastmath": FLAGS, "error_model": "numpy", "no_cfunc_wrapper": True}
    part: F = numba.njit(**usual | options)(function)
    return part


def _kernel(function: F, **options: Any) -> F:
    usual = {"fastmath": FLAGS, "error_model": "numpy", "nogil": True}
    kernel: Any = numba.njit(**usual | options)(function)
    keep(kernel, function)
    kept: F = kernel
    return kept
