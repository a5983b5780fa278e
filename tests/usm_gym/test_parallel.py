"""Tasks are done once each, whatever joblib does them with."""

import joblib
import pytest

from usm_gym import parallel


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
