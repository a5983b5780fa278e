"""What the evaluation refuses: policies, actions, scenarios and arguments."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from support.episodes import short

import usm_gym


class Unreachable:
    """A policy that must not be asked for an action."""

    privileged = False

    def predict(self, *_: Any, **__: Any) -> Any:
        raise AssertionError("the episode was begun")


class Spoiled:
    """An action that goes wrong in the third step."""

    privileged = False

    def __init__(self, spoil: Callable[[Any], Any]) -> None:
        self.spoil = spoil

    def predict(self, observation: Any, state: Any = None, *_: Any, **__: Any) -> Any:
        action = np.zeros((len(observation), 5), np.float32)
        step = 0 if state is None else state
        return (self.spoil(action) if step == 2 else action), step + 1


def test_an_episode_that_leaves_nothing_to_score_is_refused_at_once() -> None:
    scenario, other = short(2)
    everything = replace(other.inspection, times=(0.1,))
    with pytest.raises(ValueError, match="shifts"):
        usm_gym.evaluate(Unreachable(), [scenario, replace(other, inspection=everything)])


@pytest.mark.parametrize(
    "spoil",
    [
        lambda action: action * np.nan,
        lambda action: np.where(np.arange(5) == 3, np.nan, action),
        lambda action: action[:, :4],
        lambda action: action[0],
        lambda action: action[:1],
        lambda action: np.concatenate([action, action]),
        lambda action: None,
        lambda action: "ahead",
    ],
)
def test_what_is_no_action_is_refused(spoil: Callable[[Any], Any]) -> None:
    with pytest.raises(ValueError, match=r"action|convert"):
        usm_gym.evaluate(Spoiled(spoil), short(2))


@pytest.mark.parametrize("given", [Unreachable, "sta", None])
def test_what_does_not_act_is_refused(given: Any) -> None:
    with pytest.raises(ValueError, match=r"policy is .*`predict`"):
        usm_gym.evaluate(given, short(1))


@pytest.mark.parametrize(
    ("scenarios", "options", "named"),
    [([], {}, "scenarios"), (short(1), {"workers": 0}, "workers")],
)
def test_bad_arguments_are_named(scenarios: Any, options: Any, named: str) -> None:
    with pytest.raises(ValueError, match=named):
        usm_gym.evaluate(Unreachable(), scenarios, **options)
