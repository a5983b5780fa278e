"""LQG that foresees the joint motion, and learns what the robot is while it swims.

The law is that of `joint_lqg` on a plant whose coefficients, current and thruster gains are those
that `identification` estimates; commands make up for the gains.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from usm_baselines.estimation.identification import Identifier
from usm_baselines.laws.joint_lqg import JointLQG, JointLQGGains
from usm_baselines.policy import HEADING_GAIN, Percept
from usm_baselines.signals import Array
from usm_baselines.space import Gain, declared
from usm_gym.task.nominal import Nominal

_SHARED = declared(JointLQGGains)


class AdaptiveLQGGains(NamedTuple):
    """Gains of `JointLQGGains`, and those of the identification."""

    acceleration_noise: float = _SHARED["acceleration_noise"]
    disturbance_noise: float = _SHARED["disturbance_noise"]
    variation_weight: float = _SHARED["variation_weight"]
    lead: float = _SHARED["lead"]
    coefficient_spread: float = Gain(
        0.2, "1", "standard deviation of a coefficient over its nominal value", tuned=(0.01, 1.0)
    )
    current_spread: float = Gain(
        0.02, "m/s", "standard deviation of the current", tuned=(1e-3, 0.3)
    )
    gain_spread: float = Gain(
        0.08, "1", "standard deviation of a thruster's gain", tuned=(5e-3, 0.5)
    )
    forgetting: float = Gain(
        0.02, "1/sqrt(s)", "drift of all of these, over their spread", tuned=(1e-4, 1.0)
    )
    heading_gain: float = HEADING_GAIN


class AdaptiveLQG(JointLQG):
    """LQG control on the plant as it is identified on the way."""

    Gains = AdaptiveLQGGains

    def _make_predictor(self, nominal: Nominal) -> Identifier:
        own = self.gains
        spread = np.array([own.coefficient_spread, own.current_spread, own.gain_spread])
        self._identifier = Identifier(nominal, *self.densities, spread, own.forgetting * spread)
        return self._identifier

    def state_of(self, state: Array) -> dict[str, Array]:
        """The law's own numbers in what `predict` returns, by name.

        Returns:
            Those of `JointLQG`, (batch, axes); what has been identified, `coefficients` over their
            nominal values, (batch, 6), `current`, m/s, (batch, axes), and `thruster_gains`, force
            over command, (batch, thrusters); and the standard deviation of each, `NAME_std`.
        """
        own, learner = state[:, self._own :], self._identifier
        beliefs, uncertainty = learner.beliefs(own), learner.uncertainty(own)
        named = super().state_of(state)
        for name, part in {
            "coefficients": learner.coefficients,
            "current": learner.current,
            "thruster_gains": learner.gains,
        }.items():
            named |= {name: beliefs[:, part], f"{name}_std": uncertainty[:, part]}
        return named

    def decide(
        self, known: Percept, correction: Array | None = None
    ) -> tuple[NDArray[np.float32], Array]:
        """Act as `JointLQG` does, and make up for the gains that thrusters are believed to have."""
        action, state = super().decide(known, correction)
        beliefs = self._identifier.beliefs(state[:, self._own :])
        return compensated(action, beliefs[:, self._identifier.gains]), state


def compensated(action: NDArray[np.float32], gains: Array) -> NDArray[np.float32]:
    """Actions that make the forces asked for, force over command being `gains`, of their shape."""
    return np.asarray(action / gains, np.float32)
