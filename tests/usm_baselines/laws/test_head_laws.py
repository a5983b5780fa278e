"""Laws for the head: what they move joints for, and how well the head follows."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.optimize import lsq_linear
from usm_baselines import make
from usm_baselines.head import reactions, station_of
from usm_baselines.laws.whole_body import bounded
from usm_baselines.policies import shipped

from usm_gym.evaluation import evaluate, rollout
from usm_gym.simulation import Simulation
from usm_gym.suites import unseen
from usm_gym.task.head_sampling import nominal_head
from usm_gym.task.modes import ALL_HEAD_MODES, AnyHeadMode, presets_of

LAWS = ("rates-lqg-joints", "priority-lqg-joints", "whole-lqg-joints")


def episodes(mode: AnyHeadMode, count: int, conditions: str = "field") -> list[Any]:
    return list(unseen(mode, presets_of(mode)[conditions], 17, count))


@pytest.mark.parametrize("mode", ALL_HEAD_MODES)
@pytest.mark.parametrize("law", LAWS)
def test_joints_move_the_head_as_it_has_to_move(law: str, mode: AnyHeadMode) -> None:
    scenario = nominal_head(mode, presets_of(mode)["ideal"])
    simulation = Simulation([scenario])
    gains = {"damping": 1e-4} if law != LAWS[-1] else {"posture_weight": 1e-3, "horizon": 1e-2}
    if law == LAWS[-1]:
        gains |= {"reaction_weight": 1e-6, "wrench_weight": 1.0}
    policy = make(law, scenario.nominal, head_gain=4.0, **gains)
    state = None
    for _ in range(100):
        action, state = policy.predict(simulation.observation, state)
        simulation.step(action)
    action, _ = policy.predict(simulation.observation, state)
    layout, world = simulation.layout, simulation.world
    seen = simulation.observation[0] * layout.scale
    axes = len(world.axes)
    jacobian = np.empty((1, 3, scenario.body.joints))
    world.jacobians(simulation.observation, jacobian)  # type: ignore[attr-defined]
    rates = scenario.body.joint_rate_limit * action[0, world.thrusters :]
    velocity, acceleration = (
        seen[layout.slices[f"head_reference_{name}"]] for name in ("velocity", "acceleration")
    )
    wanted = velocity + 0.1 * acceleration - 4.0 * seen[layout.slices["head_error"]]
    assert np.abs(wanted).max() > 5e-3
    np.testing.assert_allclose(jacobian[0, :axes] @ rates, wanted, atol=3e-4)


@pytest.mark.parametrize("mode", ALL_HEAD_MODES)
@pytest.mark.parametrize("law", LAWS)
def test_the_head_follows_within_millimetres(law: str, mode: AnyHeadMode) -> None:
    scenarios = episodes(mode, 5)
    scores = evaluate(make(law, scenarios[0].nominal), scenarios)
    errors = [scores.per_episode[name] for name in scores.per_episode if name.startswith("max_")]
    assert not scores.failed.any()
    assert np.mean(errors, axis=1).max() < (2e-3 if mode == "head" else 6e-3)
    assert 0.0 < scores.per_episode["joint_effort"].max() < 0.2


@pytest.mark.parametrize("law", LAWS)
def test_beyond_its_reach_the_head_falls_behind_and_nothing_else_happens(law: str) -> None:
    # Feasible as it is drawn, the path is then moved away from the robot, which no check sees.
    scenario = nominal_head("head")
    simulation = Simulation([scenario])
    world: Any = simulation.world
    centre = world.rows - 16 + 1  # of the first channel of the path
    simulation._rows[0, centre, 0] += 0.45
    policy, state = make(law, scenario.nominal), None
    limit = scenario.body.joint_rate_limit
    for _ in range(1500):
        action, state = policy.predict(simulation.observation, state)
        simulation.step(action)
        assert np.abs(simulation.read("joint_reference_rates")).max() <= limit + 1e-12
    assert not simulation.lost.any()
    assert 0.05 < np.abs(simulation.error[0, 0]) < 0.5


def test_a_bounded_quadratic_program_is_solved() -> None:
    rng = np.random.default_rng(0)
    for size in (1, 4, 15, 20):
        for _ in range(50):
            A, t = rng.standard_normal((size + 2, size)), 3.0 * rng.standard_normal(size + 2)
            low, high = -rng.random(size), rng.random(size)
            found = np.empty(size)
            bounded(A.T @ A, A.T @ t, low, high, found)
            best = lsq_linear(A, t, (low, high), tol=1e-14, max_iter=1000)
            assert (found >= low).all()
            assert (found <= high).all()
            assert np.sum((A @ found - t) ** 2) <= 2.0 * best.cost + 1e-9


@pytest.mark.parametrize("mode", ALL_HEAD_MODES)
def test_a_body_turns_with_its_joints_as_is_foreseen(mode: AnyHeadMode) -> None:
    # At rest and without thrust, a joint begins to move, and the body with it.
    still = replace(presets_of(mode)["ideal"], physics_step=1e-4, control_period=1e-3)
    # Nothing but the joints turns it: centres of mass and of buoyancy coincide.
    scenario = nominal_head(mode, still, "eely-neutral" if mode == "head3d" else "paper")
    simulation = Simulation([scenario])
    world = simulation.world
    robot = scenario.station.body
    foreseen = reactions(robot, simulation.observation, simulation.layout)[0]
    action = np.zeros((1, world.actions), np.float32)
    action[0, -1] = 1.0
    for _ in range(20):
        simulation.step(action)
    if mode == "head":
        rates = simulation.read("theta_dot")[0]
        joints, turning = -np.diff(rates), np.array([rates.mean()])
    else:
        joints, turning = simulation.read("joint_rates")[0], simulation.read("angular_velocity")[0]
    assert np.abs(turning).max() > 1e-4
    np.testing.assert_allclose(foreseen @ joints, turning, rtol=0.05, atol=2e-5)


def test_the_body_is_held_with_the_gains_for_its_sensors() -> None:
    for mode, conditions, law, expected in (
        ("head", "field", "sta", "sta-tuned"),
        ("head", "ideal", "sta", "sta-tuned"),
        ("head", "basin", "sta", "sta-navigator-basin"),
        ("head", "field", "adaptive", "adaptive"),
        ("head3d", "field", "adaptive", "adaptive-eely"),
        ("head3d", "basin", "lqg-joints", "lqg-joints-eely-basin"),
    ):
        scenario: Any = nominal_head(mode, presets_of(mode)[conditions])  # type: ignore[arg-type]
        assert shipped(law, station_of(scenario.nominal)) == expected


def test_one_observation_is_answered_as_in_a_batch() -> None:
    scenarios = episodes("head", 3)
    simulation = Simulation(scenarios)
    policy = make("whole-lqg-joints", scenarios[0].nominal)
    many, _ = policy.predict(simulation.observation)
    for index in range(3):
        one, _ = policy.predict(simulation.observation[index])
        assert (one == many[index]).all()


def test_a_law_for_the_head_is_refused_where_joints_are_not_the_policy_s() -> None:
    body = nominal_head("head").station.nominal
    with pytest.raises(ValueError, match="robot"):
        make("rates-sta", body)
    with pytest.raises(ValueError, match="gains is 'k_p'"):
        make("rates-sta", nominal_head("head").nominal, k_p=1.0)
    with pytest.raises(ValueError, match="the observation's shape"):
        make("rates-sta", nominal_head("head").nominal).predict(np.zeros(3))


def test_a_privileged_law_for_the_body_is_given_the_truth() -> None:
    scenarios = episodes("head", 2)
    policy = make("whole-informed", scenarios[0].nominal)
    assert policy.privileged
    (first, _) = rollout(policy, scenarios)
    assert np.abs(first.error[500:]).max() < 2e-3
