"""What a law should have believed: labels, from the truth of a simulation."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from usm_baselines.estimation.foresight import NAMES
from usm_baselines.policy import ScriptedPolicy
from usm_baselines.signals import model_of, signals_of

from usm_gym.world import world_of

Array = NDArray[np.float64]


class Labels:
    """Compares what a law believes of a batch of robots with the truth.

    The disturbance is what the law's plant leaves out: from the true state, under the commands
    that were in effect, it misses the true rate by d h after a period h.
    """

    def __init__(self, law: ScriptedPolicy) -> None:
        """Take the law."""
        nominal = law.nominal
        self._model, self._world = model_of(nominal), world_of(nominal.robot)
        assert law.predictor is not None  # else the task would have refused it
        self._predictor, self._columns = law.predictor, law.predictor_columns

    def take(self, state: Array, error: Array, rate: Array) -> Array:
        """Corrections of error and rate, and what is to be taken from the disturbance.

        Args:
            state: State of the law after it has taken in an observation, (robots, numbers).
            error: True errors then, m, (robots, axes).
            rate: Their true rates, m/s, (robots, axes).

        Returns:
            (robots, axes, 3); `missed`, called a period later, has to be added to the last.
        """
        self._then = state[:, self._columns].copy()
        estimates = self._predictor.estimates
        believed = self._then[:, :estimates].reshape(len(state), -1, len(NAMES))
        true = np.stack([error, rate, np.zeros_like(rate)], axis=2)
        corrections = true - believed
        self._then[:, :estimates] = true.reshape(len(state), estimates)
        return corrections

    def missed(self, observation: NDArray[np.float32], rate: Array) -> Array:
        """What the law's plant has left out since `take`, m/s^2, (robots, axes).

        Args:
            observation: Plain observations now, (robots, numbers).
            rate: True rates of the error now, m/s, (robots, axes).
        """
        signals = signals_of(observation, self._model, self._world)
        signals.started[:], signals.fresh[:] = 1.0, False
        return self._predictor.miss(signals, self._then, rate)
