"""Independent tasks through joblib: processes here, or whatever backend is active."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any, TypeVar

import joblib

T = TypeVar("T")

# Tasks for each worker between two waits for all, where the active backend (Ray's) cannot hand over
# results one by one.
SHARE = 4


def results(
    function: Callable[..., T], tasks: Sequence[tuple[Any, ...]], workers: int
) -> Iterator[tuple[int, T]]:
    """Call a function with the arguments of each task.

    Args:
        function: What to call; for more than one worker it is pickled, like its arguments.
        tasks: The arguments of each call.
        workers: Number of processes; 1 means this one.

    Yields:
        The index of a task and its result, in the order in which they are done.
    """
    if workers == 1:
        yield from (_numbered(function, index, task) for index, task in enumerate(tasks))
        return
    calls = [joblib.delayed(_numbered)(function, index, task) for index, task in enumerate(tasks)]
    backend, _ = joblib.parallel.get_active_backend()
    if backend.supports_return_generator:
        yield from joblib.Parallel(n_jobs=workers, return_as="generator_unordered")(calls)
        return
    with joblib.Parallel(n_jobs=workers) as parallel:
        for first in range(0, len(calls), SHARE * workers):
            yield from parallel(calls[first : first + SHARE * workers])


def _numbered(function: Callable[..., T], index: int, task: tuple[Any, ...]) -> tuple[int, T]:
    return index, function(*task)
