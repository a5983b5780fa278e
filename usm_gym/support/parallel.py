"""Runs independent tasks through joblib, in local processes or on the active backend."""

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

# Tasks per worker between two waits for all of them, for backends (Ray's) that cannot return
# results one by one.
SHARE = 4


def results(
    function: Callable[..., T], tasks: Sequence[tuple[Any, ...]], workers: int
) -> Iterator[tuple[int, T]]:
    """Call a function once per task.

    Args:
        function: The function; with more than one worker it is pickled, like its arguments.
        tasks: The arguments of the calls.
        workers: Number of processes; 1 means this one.

    Yields:
        The index of a task and its result, in the order in which tasks end.

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
    """Yield results one by one; closing the generator stops the workers."""
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
    """Start processes that Ctrl-C does not reach, although the terminal sends it to all.

    They inherit the blocked SIGINT, and so do the threads that replace them.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    from multiprocessing import resource_tracker

    from joblib.externals.loky.backend import resource_tracker as loky_tracker

    # The trackers unblock SIGINT when they start, so they start first.
    resource_tracker.ensure_running()
    loky_tracker.ensure_running()
    previous = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, previous)


def _numbered(function: Callable[..., T], index: int, task: tuple[Any, ...]) -> tuple[int, T]:
    return index, function(*task)
