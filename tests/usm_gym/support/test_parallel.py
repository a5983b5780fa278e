"""Tasks are done once each, whatever joblib does them with."""

import os
import warnings
from typing import Any

import joblib
import pytest

from usm_gym.support import parallel


def product(a: int, b: int) -> int:
    return a * b


@pytest.mark.parametrize("streams", [True, False])
@pytest.mark.parametrize("workers", [1, 2])
def test_every_task_is_done_once(
    workers: int, streams: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    tasks = [(k, k + 1) for k in range(20)]
    with joblib.parallel_config(backend="threading"):
        backend, _ = joblib.parallel.get_active_backend()
        # Ray's backend cannot hand over results one by one.
        monkeypatch.setattr(type(backend), "supports_return_generator", streams)
        found = list(parallel.results(product, tasks, workers))
    assert sorted(found) == [(k, k * (k + 1)) for k in range(20)]


def test_a_worker_that_ends_early_is_an_error_and_the_next_tasks_are_done() -> None:
    with pytest.raises(ChildProcessError, match=r"ended before its task was done: EXIT\(3\)"):
        list(parallel.results(os._exit, [(3,), (3,)], 2))
    assert sorted(parallel.results(product, [(2, 3), (4, 5)], 2)) == [(0, 6), (1, 20)]


def test_whoever_wants_no_more_results_is_not_warned() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        results: Any = parallel.results(product, [(k, k) for k in range(20)], 2)
        next(results)
        results.close()
