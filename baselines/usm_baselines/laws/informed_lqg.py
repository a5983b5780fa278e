"""The law of `joint_lqg`, told what is constant in an episode: what identification could bring.

It measures what all measure. Beyond that it is told the true hydrodynamic coefficients, the gains
of the thrusters and the mean current; not the part of the current that varies, and no waves.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from usm_baselines.estimation.prediction import Predictor
from usm_baselines.laws.adaptive_lqg import compensated
from usm_baselines.laws.joint_lqg import JointLQG
from usm_baselines.policy import Percept
from usm_baselines.privileged import PrivilegedPolicy
from usm_baselines.signals import Array
from usm_gym.simulation import Snapshot
from usm_gym.task.nominal import Nominal


class Told(Predictor):
    """A predictor that is told what the robots are.

    Attributes:
        truth: What they are, (batch, numbers), as beliefs.
    """

    truth: Array

    def beliefs(self, state: Array) -> Array:
        """What the robots of a batch are, (batch, numbers)."""
        return self.truth

    def tell(self, scenarios: tuple[Any, ...]) -> None:
        """Take in what is constant in the episodes of a batch."""
        self.truth = np.stack([self._constants(scenario) for scenario in scenarios])

    def _constants(self, scenario: Any) -> Array:
        belief, water = self._neutral.copy(), scenario.water
        belief[self.coefficients] = water.coefficients
        belief[self.current] = water.current
        belief[self.gains] = scenario.thruster_gains or 1.0
        belief[self.factors] = water.link_factors or 1.0
        return belief


class InformedLQG(PrivilegedPolicy, JointLQG):
    """LQG control that is told what no controller can measure: no competitor."""

    def __init__(self, nominal: Nominal, **gains: Any) -> None:
        """Compute the gains of filter and regulator; gains other than the defaults by name."""
        super().__init__(nominal, **gains)
        self._scenarios: tuple[Any, ...] = ()

    def _make_predictor(self, nominal: Nominal) -> Told:
        self._told = Told(nominal, *self.densities)
        return self._told

    def take_in(self, snapshot: Snapshot) -> None:
        """Read the constants of the scenarios, and nothing else."""
        if snapshot.scenarios != self._scenarios:
            self._scenarios = snapshot.scenarios
            self._told.tell(snapshot.scenarios)

    def decide(
        self, known: Percept, correction: Array | None = None
    ) -> tuple[NDArray[np.float32], Array]:
        """Act as `JointLQG` does, and make up for the gains that thrusters have."""
        action, state = super().decide(known, correction)
        return compensated(action, self._told.truth[:, self._told.gains]), state
