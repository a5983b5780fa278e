"""A navigator that predicts by the nominal plant."""

from __future__ import annotations

from usm_baselines.estimation.prediction import Predictor, tell
from usm_baselines.signals import Array, Signals
from usm_gym.task.nominal import Nominal


class PlantNavigator:
    """A navigator as `navigator.Navigator`, but by the nominal plant.

    Attributes:
        predictor: What estimates.
        size: Numbers of memory for each robot, those of the predictor.
    """

    def __init__(
        self, nominal: Nominal, acceleration_noise: float, disturbance_noise: float
    ) -> None:
        """Set up the filter; arguments as of `Predictor`."""
        self.predictor = Predictor(nominal, acceleration_noise, disturbance_noise)
        self.size = self.predictor.size

    def estimate(self, signals: Signals, mass: float, memory: Array) -> None:
        """Predict by the nominal plant and take in what has arrived, in place.

        Args:
            signals: What was measured and applied; error, rate, disturbance and thrust are filled
                in.
            mass: Total mass, kg.
            memory: Memory of the batch, (batch, size); zero at the start.
        """
        self.predictor.estimate(signals, memory)
        tell(signals, mass, memory)
