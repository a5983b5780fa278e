"""What is learnt while swimming, in worlds in which the answer is known."""

from dataclasses import replace

import numpy as np
import pytest
from usm_baselines import registry

from usm_gym.simulation import Simulation
from usm_gym.task.conditions import PRESETS, SPATIAL_PRESETS
from usm_gym.task.sampling import sample
from usm_gym.task.spatial_sampling import sample_in_space

# Where the current is among what is learnt.
CURRENT = slice(6, 8)
# A basin in which what is to be learnt is all that the nominal plant has wrong.
STEADY = replace(
    PRESETS["basin"], current_variation=0.0, coefficient_spread=0.0, position_noise=2e-4
)


# All that is wrong has a parameter, so that little is left to the disturbance.
GAINS = {"acceleration_noise": 1e-3, "disturbance_noise": 1e-3}


def swim(scenarios, seconds):
    """What is believed after a while, and its uncertainty."""
    law = registry.make("adaptive", scenarios[0].nominal, **GAINS)
    simulation, state = Simulation(scenarios), None
    start = np.ones(len(scenarios), bool)
    for _ in range(round(seconds / scenarios[0].conditions.control_period)):
        action, state = law.predict(simulation.observation, state, start)
        start[:] = False
        simulation.step(action)
    found = law.state_of(state)
    parts = ("coefficients", "current", "thruster_gains")
    return tuple(np.hstack([found[part + end] for part in parts]) for end in ("", "_std"))


def truth_of(scenario):
    return np.concatenate(
        [scenario.water.coefficients, scenario.water.current, scenario.thruster_gains]
    )


def test_current_drag_and_added_mass_are_found() -> None:
    scenarios = [sample("operation", STEADY, np.random.default_rng(k)) for k in range(8)]
    beliefs, uncertainty = swim(scenarios, 40.0)
    truth = np.stack(list(map(truth_of, scenarios)))
    off = beliefs - truth
    guess = np.ones(truth.shape[1])
    guess[CURRENT] = 0.0
    before = np.sqrt(np.mean((truth - guess) ** 2, axis=0))
    after = np.sqrt(np.mean(off**2, axis=0))
    # Drag along and across, added mass, current: they move the centre of mass.
    moving = [0, 1, 2, 6, 7]
    assert (after[moving] < 0.5 * before[moving]).all()
    # What is said of the uncertainty is neither vain nor far from the truth.
    ratio = off / uncertainty
    assert 0.5 < np.sqrt(np.mean(ratio**2)) < 2.0


def test_in_the_nominal_world_nothing_is_learnt() -> None:
    nominal = replace(
        STEADY, coefficient_range=(1.0, 1.0), thruster_gain_range=(1.0, 1.0), current_limit=0.0
    )
    scenarios = [sample("operation", nominal, np.random.default_rng(k)) for k in range(4)]
    beliefs, uncertainty = swim(scenarios, 20.0)
    guess = np.ones(beliefs.shape[1])
    guess[CURRENT] = 0.0
    off = np.abs(beliefs - guess) / uncertainty
    assert off.max() < 4.0
    assert np.sqrt(np.mean(off**2)) < 1.5


def test_the_more_it_swims_the_more_it_knows() -> None:
    scenarios = [sample("operation", STEADY, np.random.default_rng(k)) for k in range(2)]
    _, early = swim(scenarios, 4.0)
    _, late = swim(scenarios, 30.0)
    assert (late[:, 1] < 0.5 * early[:, 1]).all()


def test_in_space_added_mass_current_and_gains_are_found() -> None:
    conditions = replace(
        SPATIAL_PRESETS["basin"], current_variation=0.0, coefficient_spread=0.0, position_noise=2e-4
    )
    drawn = [sample_in_space("operation3d", conditions, np.random.default_rng(k)) for k in range(8)]
    beliefs, uncertainty = swim(drawn, 30.0)
    off = beliefs - np.stack(list(map(truth_of, drawn)))
    guess = np.ones(beliefs.shape[1])
    guess[6:9] = 0.0
    before = np.sqrt(np.mean((guess - (beliefs - off)) ** 2, axis=0))
    after = np.sqrt(np.mean(off**2, axis=0))
    # Added mass across, current to the side and up, gains: what moves it to the side and up.
    moving = [1, 7, 8, *range(9, 16)]
    assert np.mean(after[moving] / before[moving]) < 0.7
    assert after[1] < 0.6 * before[1]
    assert np.median(np.abs(off / uncertainty)) < 2.0


@pytest.mark.parametrize("batch", [1, 3])
def test_a_robot_learns_the_same_beside_others(batch: int) -> None:
    scenarios = [sample("operation", STEADY, np.random.default_rng(k)) for k in range(3)]
    together, _ = swim(scenarios, 2.0)
    some, _ = swim(scenarios[:batch], 2.0)
    np.testing.assert_array_equal(some, together[:batch])
