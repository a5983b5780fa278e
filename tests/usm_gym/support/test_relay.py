"""Calls of other processes arrive, each once."""

import threading

from usm_gym.support import parallel
from usm_gym.support.relay import Relay, relayed


def send(relay: Relay, index: int) -> int:
    for value in (0.25, 0.5):
        relay(index, value)
    return threading.active_count()


def test_calls_of_other_processes_arrive_once_each() -> None:
    heard: list[tuple[int, float]] = []
    with relayed(lambda index, value: heard.append((index, value))) as relay:
        tasks = [(relay, index) for index in range(20)]
        assert len(list(parallel.results(send, tasks, 2))) == 20
    assert sorted(heard) == [(index, value) for index in range(20) for value in (0.25, 0.5)]


def test_a_call_after_the_end_or_on_another_machine_does_nothing() -> None:
    heard: list[int] = []
    with relayed(lambda index, value: heard.append(index)) as relay:
        relay(1, 1.0)
    relay(2, 1.0)
    Relay("nowhere/calls")(3, 1.0)
    assert heard == [1]
