"""Independent tasks through joblib: processes here, or whatever backend is active."""

from __future__ import annotations

import re
import signal
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
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

    Raises:
        ChildProcessError: If a worker process ends before its task is done.
    """
    if workers == 1:
        yield from (_numbered(function, index, task) for index, task in enumerate(tasks))
        return
    calls = [joblib.delayed(_numbered)(function, index, task) for index, task in enumerate(tasks)]
    backend, _ = joblib.parallel.get_active_backend()
    try:
        if backend.supports_return_generator:
            yield from _streamed(calls, workers)
            return
        with joblib.Parallel(n_jobs=workers) as parallel:
            for first in range(0, len(calls), SHARE * workers):
                yield from parallel(calls[first : first + SHARE * workers])
    except BrokenProcessPool as error:
        statuses = ", ".join(re.findall(r"\w+\(-?\d+\)", str(error))) or str(error)
        raise ChildProcessError(
            f"a worker process ended before its task was done: {statuses}"
        ) from error


def _streamed(calls: Sequence[Any], workers: int) -> Iterator[Any]:
    """Results one by one; whoever wants no more of them stops the workers."""
    outcomes: Any = None
    try:
        with _sheltered_from_ctrl_c():
            outcomes = joblib.Parallel(n_jobs=workers, return_as="generator_unordered")(calls)
        for outcome in outcomes:  # noqa: UP028 ("yield from" would close it first, with a warning)
            yield outcome
    finally:
        if outcomes is not None:
            with warnings.catch_warnings(action="ignore"):
                outcomes.close()


@contextmanager
def _sheltered_from_ctrl_c() -> Iterator[None]:
    """Start processes that Ctrl-C does not reach, though the terminal sends it to all.

    They inherit that SIGINT is blocked, as do the threads which start others in their place.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    from multiprocessing import resource_tracker

    from joblib.externals.loky.backend import resource_tracker as loky_tracker

    # These unblock it when they have started; so they start first.
    resource_tracker.ensure_running()
    loky_tracker.ensure_running()
    previous = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, previous)


def _numbered(function: Callable[..., T], index: int, task: tuple[Any, ...]) -> tuple[int, T]:
    return index, function(*task)
