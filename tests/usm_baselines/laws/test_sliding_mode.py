"""The sliding-mode law stays in its boundary layer and leaves no offset."""

import numba
import numpy as np
import pytest
import usm_baselines
from usm_baselines.laws import sliding_mode

from usm_gym import Robot
from usm_gym.task.nominal import Nominal
from usm_gym.task.observation import ObservationLayout

NOMINAL = Nominal(Robot(), 0.02, 0.0, 0.0)
LAYOUT = ObservationLayout(16, 5)


@numba.njit
def switching(s, boundary, eta):  # type: ignore[no-untyped-def]
    return sliding_mode.switching(s, boundary, eta)


def test_the_switching_term_is_linear_inside_the_layer_and_bounded_outside() -> None:
    for s, expected in ((0.05, -1.0), (-0.1, 2.0), (0.3, -2.0), (-9.0, 2.0), (0.0, 0.0)):
        assert switching(s, 0.1, 2.0) == pytest.approx(expected)


def test_a_double_integrator_is_brought_to_rest_under_a_constant_push() -> None:
    policy = usm_baselines.make(
        "smc", NOMINAL, observer_gain=20.0, eta=2.0, boundary=0.1, surface=3.0
    )
    observation = np.zeros(LAYOUT.size, np.float32)
    observation[LAYOUT.slices["thruster_limit"]] = 5.0  # 100 N
    h, mass, limit = 0.02, NOMINAL.robot.total_mass, 100.0
    x, v, state, surfaces = 0.02, 0.0, None, []
    for _ in range(500):
        observation[0] = x / 0.01
        action, state = policy.predict(observation, state)
        a = float(action[0]) * limit / mass + 0.5
        observation[LAYOUT.slices["thruster_command"]] = np.clip(action, -1.0, 1.0)
        x, v = x + h * v + 0.5 * h * h * a, v + h * a
        kept = {name: numbers[0, 0] for name, numbers in policy.state_of(state).items()}
        surfaces.append(kept["rate"] + 6.0 * kept["error"] + 9.0 * kept["integral"])
    assert surfaces[0] == 0.0
    # The push of 0.5 m/s^2 bends s by 0.5 / 2 of the layer.
    assert np.abs(surfaces).max() < 0.1
    assert surfaces[-1] == pytest.approx(0.1 * 0.5 / 2.0, rel=0.05)
    assert x == pytest.approx(0.0, abs=1e-4)


@pytest.mark.parametrize("name", ["surface", "boundary", "observer_gain"])
def test_gains_of_nothing_are_refused(name: str) -> None:
    with pytest.raises(ValueError, match=f"{name} is 0.0; allowed"):
        usm_baselines.make("smc", NOMINAL, **{name: 0.0})
