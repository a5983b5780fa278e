"""Policies act alike alone and in a batch, and keep nothing that the caller does not carry."""

import pickle
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
import usm_baselines
from numpy.typing import NDArray
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv
from support import oracle
from support.ball import BallScenario
from support.episodes import HARDER
from usm_baselines.laws.super_twisting import SuperTwistingGains
from usm_baselines.policy import Percept, ScriptedPolicy
from usm_baselines.signals import Signals

from tests.support.signals import made_signals
from usm_gym import Robot, evaluate
from usm_gym.task.conditions import PRESETS
from usm_gym.task.observation import ObservationLayout
from usm_gym.task.sampling import named

Array = NDArray[np.float64]

SCRIPTED = (
    *("sta", "sta-explicit", "pd", "pd-mass", "pd-observer"),
    *("pid", "ladrc", "lqg", "lqg-joints", "mpc", "smc", "gsta", "agsta", "heading", "zero"),
)
LAYOUT = ObservationLayout(16, 5)


def made(id: str) -> Any:
    return usm_baselines.make(id, gym.make("USM-Operation-v0"))


def observations(
    steps: int, robots: int, seed: int = 0, conditions: Any = HARDER
) -> NDArray[np.float32]:
    """Return live observations of some robots that wobble about, (steps, robots, 94)."""
    rng = np.random.default_rng(seed)
    seen = np.empty((steps, robots, LAYOUT.size), np.float32)
    for robot in range(robots):
        env = gym.make("USM-Operation-v0", conditions=conditions)
        seen[0, robot], _ = env.reset(seed=seed + robot)
        for k in range(1, steps):
            action = rng.uniform(-1.0, 1.0, 5).astype(np.float32)
            seen[k, robot] = env.step(action)[0]
    return seen


@pytest.mark.parametrize("tier", ["basin", "sea"])
@pytest.mark.parametrize("id", ["sta-navigator", "lqg", "lqg-joints", "mpc", "adaptive"])
def test_with_a_navigator_the_bits_are_the_same_alone_and_in_a_batch(id: str, tier: str) -> None:
    policy = usm_baselines.make(id, named("nominal", "operation", PRESETS[tier]).nominal)
    seen, batch = observations(30, 3, conditions=tier), None
    singles: list[Any] = [None] * 3
    for now in seen:
        actions, batch = policy.predict(now, batch)
        for k in range(3):
            action, singles[k] = policy.predict(now[k], singles[k])
            np.testing.assert_array_equal(action, actions[k])


@pytest.mark.parametrize("id", SCRIPTED)
def test_alone_and_in_a_batch_the_bits_are_the_same(id: str) -> None:
    policy = made(id)
    seen = observations(30, 3)
    singles: list[Any] = [None] * 3
    batch = None
    for now in seen:
        actions, batch = policy.predict(now, batch)
        assert actions.shape == (3, 5)
        assert actions.dtype == np.float32
        for k in range(3):
            action, singles[k] = policy.predict(now[k], singles[k])
            assert action.shape == (5,)
            assert np.array_equal(action, actions[k])
            if batch is not None:
                assert np.array_equal(singles[k], batch[k : k + 1])
        # A batch of one is a batch.
        assert policy.predict(now[:1])[0].shape == (1, 5)


@pytest.mark.parametrize("id", SCRIPTED)
def test_the_caller_carries_the_state(id: str) -> None:
    policy = made(id)
    seen = observations(20, 2)
    state, states, actions = None, [], []
    for now in seen:
        action, state = policy.predict(now, state)
        states.append(None if state is None else state.copy())
        actions.append(action)
    # Any moment may be gone back to, in any order, with the same or an equal policy.
    for k in (15, 3, 9):
        for other in (policy, made(id)):
            before = None if states[k - 1] is None else states[k - 1].copy()
            now = seen[k].copy()
            action, state = other.predict(now, before)
            assert np.array_equal(action, actions[k])
            if before is not None:
                assert np.array_equal(state, states[k])
                assert np.array_equal(before, states[k - 1])  # nor is what was given altered
            assert np.array_equal(now, seen[k])


@pytest.mark.parametrize("id", SCRIPTED)
def test_an_episode_start_forgets_its_rows_only(id: str) -> None:
    policy = made(id)
    seen = observations(12, 3)
    state = None
    for now in seen[:-1]:
        _, state = policy.predict(now, state)
    kept, kept_state = policy.predict(seen[-1], state)
    fresh, fresh_state = policy.predict(seen[-1])
    start = np.array([False, True, False])
    mixed, mixed_state = policy.predict(seen[-1], state, start)
    assert np.array_equal(mixed, np.where(start[:, None], fresh, kept))
    none_starts, _ = policy.predict(seen[-1], state, np.zeros(3, bool))
    all_start, _ = policy.predict(seen[-1], state, np.ones(3, bool))
    assert np.array_equal(none_starts, kept)
    assert np.array_equal(all_start, fresh)
    if id in ("heading", "zero"):  # they remember nothing
        return
    assert not np.array_equal(kept, fresh)
    assert np.array_equal(mixed_state, np.where(start[:, None], fresh_state, kept_state))
    single, _ = policy.predict(seen[-1, 0], state[:1], True)
    assert np.array_equal(single, fresh[0])


@pytest.mark.parametrize("id", SCRIPTED[:-1])
@pytest.mark.parametrize("shape", [(93,), (95,), (0,), (2, 93), (1, 1, 94), ()])
def test_observations_of_a_wrong_shape_are_refused(id: str, shape: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match="observation"):
        made(id).predict(np.zeros(shape, np.float32))


@pytest.mark.parametrize("id", SCRIPTED[:-1])
def test_states_and_starts_of_a_wrong_shape_are_refused(id: str) -> None:
    policy = made(id)
    seen = observations(1, 2)[0]
    _, state = policy.predict(seen)
    for wrong in (state[:1], state[:, :-1], state[0], np.zeros((3, *state.shape[1:]))):
        with pytest.raises(ValueError, match="state"):
            policy.predict(seen, wrong)
    with pytest.raises(ValueError, match=r"."):
        policy.predict(seen, state, np.zeros(3, bool))


@pytest.mark.parametrize("id", SCRIPTED)
def test_policies_pickle(id: str) -> None:
    policy = made(id)
    seen = observations(5, 2)
    again = pickle.loads(pickle.dumps(policy))
    state = other = None
    for now in seen:
        action, state = policy.predict(now, state)
        same, other = again.predict(now, other)
        assert np.array_equal(action, same)


@pytest.mark.parametrize("id", SCRIPTED)
def test_deterministic_or_not_is_the_same(id: str) -> None:
    policy = made(id)
    seen = observations(1, 2)[0]
    for deterministic in (True, False):
        action, _ = policy.predict(seen, None, None, deterministic)
        assert np.array_equal(action, policy.predict(seen)[0])


class Probe(ScriptedPolicy):
    """A law that asks for a fixed force and keeps what it saw."""

    Gains = SuperTwistingGains
    state = ("calls", "error")

    def control(self, signals: Signals, state: Array, force: Array) -> None:
        self.seen = signals
        state[:, :, 0] += 1.0
        state[:, :, 1] = signals.y
        force[:] = [3.0, -2.0]


def probe() -> Probe:
    return Probe(gym.make("USM-Operation-v0").unwrapped.nominal)


def test_the_state_is_what_the_law_left_by_its_names() -> None:
    policy, seen = probe(), observations(2, 3)
    _, state = policy.predict(seen[0])
    _, state = policy.predict(seen[1], state)
    left = policy.state_of(state)
    assert list(left) == ["calls", "error"]
    assert np.array_equal(left["calls"], np.full((3, 2), 2.0))
    assert np.array_equal(left["error"], policy.seen.y)


@pytest.mark.parametrize("id", SCRIPTED[:-1])
def test_every_law_names_its_numbers(id: str) -> None:
    policy, seen = made(id), observations(12, 3)
    state = None
    for now in seen:
        _, state = policy.predict(now, state)
    left = policy.state_of(state)
    assert set(policy.shown) <= set(left)
    assert all(numbers.shape == (3, 2) for numbers in left.values())
    if "error" in left:  # an estimate, millimetres from what is measured
        measured = seen[-1][:, LAYOUT.slices["position_error"]] * 0.01
        np.testing.assert_allclose(left["error"], measured, atol=5e-3)


@pytest.mark.parametrize(
    "id", ["sta", "sta-explicit", "pd", "pid", "ladrc", "smc", "gsta", "agsta"]
)
def test_laws_do_not_know_how_many_axes_there_are(id: str) -> None:
    policy = made(id)
    rng = np.random.default_rng(0)
    (y, u, velocity, acceleration), started = rng.normal(0.0, 0.1, (4, 2, 3)), np.zeros(2)
    whole, parts = np.zeros((2, 3, len(policy.state))), np.zeros((3, 2, 1, len(policy.state)))
    force, part = np.empty((2, 3)), np.empty((2, 1))
    for _ in range(3):
        policy.control(made_signals(started, y, u, velocity, acceleration), whole, force)
        for axis, own in enumerate(parts):
            one = (each[:, [axis]].copy() for each in (y, u, velocity, acceleration))
            policy.control(made_signals(started, *one), own, part)
            assert np.array_equal(force[:, [axis]], part)
        started, y = np.ones(2), y + 0.01


@pytest.mark.parametrize("id", ["lqg-joints", "mpc", "sta-navigator"])
def test_laws_that_foresee_refuse_robots_that_nothing_foresees(id: str) -> None:
    with pytest.raises(ValueError, match=r"robot is Ball\(.*\); allowed: one whose motion"):
        usm_baselines.make(id, BallScenario().nominal)


@pytest.mark.parametrize("id", ["lqg", "dob"])
def test_laws_on_the_linear_model_need_no_more_than_the_straight_body(id: str) -> None:
    policy = usm_baselines.make(id, BallScenario().nominal)
    scores = evaluate(policy, [BallScenario()]).per_episode
    assert max(scores[f"max_error_{axis}"][0] for axis in "xyz") < 1e-3


def angles(observation: NDArray[np.float32]) -> Array:
    """Return the link angles that an observation tells of."""
    values = observation * LAYOUT.scale
    joints = values[LAYOUT.slices["joint_angles"]]
    return np.asarray(values[LAYOUT.slices["tail_angle"]] - np.r_[0.0, np.cumsum(joints)])


def test_a_law_sees_the_measurement_and_the_reference_in_si_units() -> None:
    policy = probe()
    seen = observations(8, 2)[-1]
    policy.predict(seen)
    values = seen * LAYOUT.scale
    for name, signal in (
        ("position_error", policy.seen.y),
        ("reference_velocity", policy.seen.velocity),
        ("reference_acceleration", policy.seen.acceleration),
    ):
        np.testing.assert_allclose(signal, values[:, LAYOUT.slices[name]], rtol=1e-12)
    assert not policy.seen.started.any()


def test_the_applied_force_is_the_saturated_command_at_the_angles_of_its_time() -> None:
    policy = probe()
    robot = Robot()
    env = gym.make("USM-Operation-v0", conditions={"thruster_limit": 7.0})
    rng = np.random.default_rng(0)
    before, _ = env.reset(seed=0)
    _, state = policy.predict(before)
    turned = saturated = 0
    for _ in range(40):
        # Not what the policy asked for: an environment may have been told something else.
        action = rng.normal(0.0, 1.0, 5).astype(np.float32)
        now, *_ = env.step(action)
        _, state = policy.predict(now, state)
        T = oracle.input_matrix(robot, angles(before))[robot.links :, robot.links - 1 :]
        command = 7.0 * np.clip(action, -1.0, 1.0)
        acceleration = now[LAYOUT.slices["reference_acceleration"]] * 0.1
        expected = T @ command / robot.total_mass - acceleration
        np.testing.assert_allclose(policy.seen.u[0], expected, rtol=1e-5, atol=1e-6)
        turned += np.abs(angles(now) - angles(before)).max() > 1e-4
        saturated += (np.abs(action) > 1.0).any()
        before = now
    assert min(turned, saturated) > 10


def test_the_action_makes_the_force_and_a_moment_against_the_heading_error() -> None:
    policy = probe()
    robot = Robot()
    for seen in observations(40, 1)[:, 0]:
        action, _ = policy.predict(seen)
        G = oracle.input_matrix(robot, angles(seen))[:, robot.links - 1 :]
        heading = seen[LAYOUT.slices["heading_error"]][0] * 0.1
        thrust = 15.0 * action.astype(float)
        np.testing.assert_allclose(G[robot.links :] @ thrust, [3.0, -2.0], atol=2e-5)
        moment = G[: robot.links].sum(axis=0) @ thrust
        assert moment == pytest.approx(-100.0 * heading, abs=2e-5)


def test_a_law_without_a_state_of_its_own_may_be_written() -> None:
    class Stateless(Probe):
        state = ()

        def control(self, signals: Signals, state: Array, force: Array) -> None:
            assert state.shape == (3, 2, 0)
            force[:] = 0.0

    policy = Stateless(gym.make("USM-Operation-v0").unwrapped.nominal)
    action, state = policy.predict(observations(1, 3)[0])
    assert action.shape == (3, 5)
    policy.predict(observations(1, 3)[0], state)


EPISODE = 40  # steps


def short() -> gym.Env[Any, Any]:
    return Monitor(gym.wrappers.TimeLimit(gym.make("USM-Operation-v0"), EPISODE))


def by_hand(policy: Any, seed: int, episodes: int) -> list[float]:
    """Return the returns of one environment's first episodes, each begun without a state."""
    env = short()
    returns = []
    for episode in range(episodes):
        observation, _ = env.reset(seed=seed) if episode == 0 else env.reset()
        state, total, over = None, 0.0, False
        while not over:
            action, state = policy.predict(observation, state)
            observation, reward, terminated, truncated, _ = env.step(np.clip(action, -1.0, 1.0))
            total += float(np.float32(reward))  # as DummyVecEnv keeps it
            over = terminated or truncated
        returns.append(total)
    return returns


@pytest.mark.parametrize("id", SCRIPTED)
def test_stable_baselines_evaluates_every_policy(id: str) -> None:
    policy = made(id)
    envs = DummyVecEnv([short, short])
    envs.seed(5)  # environment k is seeded with 5 + k
    returns, lengths = evaluate_policy(policy, envs, n_eval_episodes=4, return_episode_rewards=True)
    assert lengths == [EPISODE] * 4
    expected = [by_hand(policy, 5, 2), by_hand(policy, 6, 2)]
    np.testing.assert_allclose(returns, np.transpose(expected).ravel(), rtol=1e-6)
    assert len(set(returns)) == 4


@pytest.mark.parametrize("id", ["sta-navigator", "lqg-joints", "mpc-limits", "adaptive"])
def test_a_correction_is_as_if_the_law_believed_so_and_halves_are_the_whole(id: str) -> None:
    policy: Any = usm_baselines.make(id, named("nominal", "operation", PRESETS["basin"]).nominal)
    rng, state, place = np.random.default_rng(0), None, policy.predictor_columns
    start, largest = np.ones(3, bool), 0.0
    for now in observations(20, 3, conditions="basin"):
        action, new = policy.predict(now, state, start)
        known = policy.perceive(now, state, start)
        correction = rng.normal(0.0, (1e-3, 1e-2, 0.1), (3, 2, 3))
        corrected, _ = policy.decide(known, correction)
        # Not for the worse of what is known.
        halves, kept = policy.decide(known)
        assert (halves.tobytes(), kept.tobytes()) == (action.tobytes(), new.tobytes())
        believed = known.state.copy()
        believed[:, place][:, :6] += correction.reshape(3, 6)
        error, rate, disturbance = np.moveaxis(believed[:, place][:, :6].reshape(3, 2, 3), 2, 0)
        signals = known.signals._replace(y=error, rate=rate, disturbance=disturbance)
        assert policy.decide(Percept(signals, believed))[0].tobytes() == corrected.tobytes()
        whole, _ = policy.predict(now, state, start, correction=correction)
        assert whole.tobytes() == corrected.tobytes()
        largest = max(largest, np.abs(corrected - action).max())
        state, start = new, rng.random(3) < 0.2
    assert largest > 1e-2


@pytest.mark.parametrize("id", ["sta-navigator", "lqg-joints", "mpc", "adaptive"])
def test_a_correction_changes_what_a_law_does_and_not_what_it_believes(id: str) -> None:
    nominal = named("nominal", "operation", PRESETS["basin"]).nominal
    policy: Any = usm_baselines.make(id, nominal)
    seen, state = observations(20, 2, conditions="basin"), None
    for now in seen:
        before = state
        action, state = policy.predict(now, before)
        same, kept = policy.predict(now, before, correction=np.zeros((2, 2, 3)))
        np.testing.assert_array_equal(action, same)
        np.testing.assert_array_equal(state, kept)
        corrected, kept = policy.predict(now, before, correction=np.full((2, 2, 3), 1e-3))
        believed = policy.predictor_columns
        np.testing.assert_array_equal(state[:, believed], kept[:, believed])
    assert (action != corrected).any()


def test_a_law_that_estimates_nothing_takes_no_correction() -> None:
    policy = made("sta")
    with pytest.raises(ValueError, match="correction"):
        policy.predict(observations(1, 1)[0], correction=np.zeros((1, 2, 3)))
