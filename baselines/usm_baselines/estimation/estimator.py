"""Where robots are and where they will be, by the nominal plant, run beside a policy."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from usm_baselines.estimation.navigator import ACCELERATION_NOISE, DISTURBANCE_NOISE
from usm_baselines.estimation.plant_navigator import PlantNavigator
from usm_baselines.estimation.prediction import Predictor
from usm_baselines.signals import Array, Signals, model_of, sense, shared_size, signals_of
from usm_gym.task.nominal import Nominal
from usm_gym.world import world_of

# How far ahead it looks, control periods.
LEADS = (2, 5, 10)
_ROWS = np.array(LEADS) - 1


class Estimate(NamedTuple):
    """What is known of a batch of robots.

    Attributes:
        signals: What was measured and applied, and what is estimated from it.
        ahead: (error, rate) in m and m/s after each of `LEADS` if the last commands are held,
            (leads, batch, axes, 2).
    """

    signals: Signals
    ahead: Array


def foreseen(predictor: Predictor, signals: Signals, state: Array) -> Estimate:
    """What is known by the estimates that are among the signals.

    Args:
        predictor: What looks ahead.
        signals: What was measured, applied and estimated.
        state: State of the predictor, (batch, size).
    """
    return Estimate(signals, predictor.foresee(signals, state, LEADS[-1])[_ROWS])


class Estimator:
    """What laws with a navigator and foresight know, for whatever is not a law.

    Like a policy it keeps nothing itself: the state travels with the caller.
    """

    def __init__(self, nominal: Nominal) -> None:
        """Set up the navigator.

        Args:
            nominal: Nominal knowledge.

        Raises:
            ValueError: If nothing foresees the robot.
        """
        self._world, self._model = world_of(nominal.robot), model_of(nominal)
        self._shared = shared_size(self._model)
        self._navigator = PlantNavigator(nominal, ACCELERATION_NOISE, DISTURBANCE_NOISE)

    def update(
        self, observation: NDArray[np.float32], state: Array | None, start: NDArray[np.bool_]
    ) -> tuple[Estimate, Array]:
        """Take in a batch of observations.

        Args:
            observation: Plain observations, (batch, numbers).
            state: What the last call returned; None at the start.
            start: Where an episode starts, (batch,).

        Returns:
            What is known, and the state for the next call.
        """
        model, size, shared = self._model, observation.shape[0], self._shared
        if state is None:
            new = np.zeros((size, shared + self._navigator.size))
        else:
            new = state.copy()
            new[start] = 0.0
        signals = signals_of(observation, model, self._world, navigated=True)
        sense(new, model, signals)
        memory = new[:, shared:].copy()
        self._navigator.estimate(signals, model.mass, memory)
        new[:, 0] = 1.0
        known = signals.allocation[:, : model.axes].reshape(size, -1)
        new[:, 1 : 1 + known.shape[1]] = known
        new[:, shared:] = memory
        return foreseen(self._navigator.predictor, signals, memory), new
