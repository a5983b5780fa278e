"""The environments as a user meets them: through `gym.make`."""

import dataclasses
import json
import warnings

import gymnasium as gym
import numpy as np
import pytest
import usm_baselines
from support.episodes import NOISY

import usm_gym

IDS = ("USM-Operation-v0", "USM-Torpedo-v0")
SPATIAL_IDS = ("USM-Operation3D-v0", "USM-Torpedo3D-v0")
KEYS = {
    "error_x",
    "error_y",
    "max_error_x",
    "max_error_y",
    "heading_error",
    "thrust_effort",
    "diverged",
}


def rollout(env, steps, seed=0, policy_id="sta"):
    """Observations, rewards and errors of a seeded episode under a policy."""
    policy = usm_baselines.make(policy_id, env)
    observation, info = env.reset(seed=seed)
    state, record = None, [(observation, 0.0, info)]
    for _ in range(steps):
        action, state = policy.predict(observation, state)
        observation, reward, terminated, truncated, info = env.step(action)
        record.append((observation, reward, info))
        if terminated or truncated:
            break
    return record


@pytest.mark.parametrize("id", [*IDS, *SPATIAL_IDS])
@pytest.mark.parametrize("render_mode", [None, "human", "rgb_array"])
def test_checkers_have_no_complaint(id, checkers, render_mode):
    env = gym.make(id, render_mode=render_mode).unwrapped
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for check in checkers:
            check(env)


@pytest.mark.parametrize("id", IDS)
def test_an_episode_is_truncated_at_its_duration(id):
    record = rollout(gym.make(id), 3000)
    assert len(record) - 1 == 2000
    assert all(set(info) == KEYS for _, _, info in record)
    assert all(info["diverged"] == 0 for _, _, info in record)


def test_observations_stay_inside_their_bounds_and_vary():
    env = gym.make("USM-Operation-v0", conditions=NOISY)
    observations = np.array([o for o, _, _ in rollout(env, 2000)])
    assert env.observation_space.shape == (94,)
    assert len(observations) == 2001
    assert (np.abs(observations) < env.observation_space.high).sum() > 0
    assert all(env.observation_space.contains(o) for o in observations)
    layout = env.unwrapped.layout
    constant = {"thruster_limit"}
    for name, part in layout.slices.items():
        assert (np.ptp(observations[:, part], axis=0).max() > 0) == (name not in constant), name


def test_observation_is_what_the_table_says():
    env = gym.make("USM-Operation-v0", conditions={"position_noise": 0.0})
    policy = usm_baselines.make("sta", env)
    observation, _ = env.reset(options={"scenario": "nominal"})
    state = None
    for _ in range(700):
        action, state = policy.predict(observation, state)
        observation, *_, info = env.step(action)
    layout = env.unwrapped.layout
    seen = {name: (observation * layout.scale)[part] for name, part in layout.slices.items()}
    simulation = env.unwrapped.simulation
    theta = simulation.read("theta")[0]
    path = env.unwrapped.scenario.path
    s = 14.0 - path.ramp / 2
    phase = path.frequency * s
    slope = path.amplitude * path.frequency
    velocity = [path.speed, slope * np.cos(phase)]
    acceleration = [0.0, -slope * path.frequency * np.sin(phase)]
    reference = np.array([path.speed * s, path.amplitude * np.sin(phase)])
    error = simulation.read("position")[0] - reference
    close = {"rtol": 2e-7, "atol": 1e-9}
    np.testing.assert_allclose(seen["position_error"], error, **close)
    np.testing.assert_allclose([info["error_x"], info["error_y"]], error, atol=1e-15)
    np.testing.assert_allclose(seen["reference_velocity"], velocity, **close)
    np.testing.assert_allclose(seen["reference_acceleration"], acceleration, **close)
    np.testing.assert_allclose(seen["tail_angle"], theta[:1], **close)
    np.testing.assert_allclose(seen["joint_angles"], theta[:-1] - theta[1:], **close)
    np.testing.assert_allclose(seen["heading_error"], [theta.mean()], **close)
    # Four seconds after its step, 0.98 rad over the last eleven of fifteen joints.
    settled = np.r_[np.zeros(4), np.full(11, 0.98 / 11)]
    np.testing.assert_allclose(seen["joint_references"], settled, atol=1e-6)
    np.testing.assert_allclose(seen["thruster_limit"], [20.0], **close)
    np.testing.assert_allclose(seen["thruster_command"], np.clip(action, -1, 1), **close)


def test_info_is_numpy_scalars_that_json_takes():
    env = gym.make("usm_gym:USM-Operation-v0")
    _, first = env.reset(seed=0)
    *_, info = env.step(np.ones(5, np.float32))
    for each in (first, info):
        assert {type(value) for value in each.values()} == {np.float64}
        assert json.loads(json.dumps(each)) == each


def test_equal_seeds_give_equal_bits_and_others_do_not():
    first, second, third = (rollout(gym.make("USM-Operation-v0"), 300, seed) for seed in (7, 7, 8))
    for (a, r, i), (b, s, j) in zip(first, second, strict=True):
        assert (a == b).all()
        assert r == s
        assert i == j
    assert (first[-1][0] != third[-1][0]).any()


@pytest.mark.parametrize("vector", [gym.vector.SyncVectorEnv, gym.vector.AsyncVectorEnv])
def test_gymnasiums_vector_environments_give_the_same_bits(vector):
    def make():
        return gym.make("usm_gym:USM-Operation-v0")

    options = {"context": "spawn"} if vector is gym.vector.AsyncVectorEnv else {}
    envs = vector([make, make], **options)
    singles = [make(), make()]
    try:
        batch, _ = envs.reset(seed=[3, 4])
        single = [env.reset(seed=seed)[0] for env, seed in zip(singles, (3, 4), strict=True)]
        assert (batch == np.stack(single)).all()
        actions = np.random.default_rng(0).uniform(-1, 1, (60, 2, 5)).astype(np.float32)
        for action in actions:
            batch, rewards, *_ = envs.step(action)
            outcomes = [env.step(a) for env, a in zip(singles, action, strict=True)]
            assert (batch == np.stack([o[0] for o in outcomes])).all()
            assert rewards.tolist() == [o[1] for o in outcomes]
    finally:
        envs.close()


def test_snapshot_and_restore_repeat_the_same_bits():
    env = gym.make("USM-Operation-v0", conditions="basin")
    actions = np.random.default_rng(1).uniform(-0.2, 0.2, (200, 5)).astype(np.float32)
    env.reset(seed=5)
    for action in actions[:100]:
        env.step(action)
    snapshot = env.unwrapped.snapshot()
    first = [env.step(action) for action in actions[100:]]
    env.reset(seed=6)
    env.unwrapped.restore(snapshot)
    second = [env.step(action) for action in actions[100:]]
    for a, b in zip(first, second, strict=True):
        assert (a[0] == b[0]).all()
        assert a[1:] == b[1:]


def test_a_lost_robot_ends_the_episode_with_a_finite_observation_and_the_bill():
    env = gym.make("USM-Operation-v0")
    env.reset(options={"scenario": "nominal"})
    rewards = []
    while True:
        observation, reward, terminated, truncated, info = env.step(np.ones(5, np.float32))
        rewards.append(reward)
        if terminated or truncated:
            break
    assert terminated
    assert not truncated
    assert info["diverged"] == 1
    assert max(abs(info["error_x"]), abs(info["error_y"])) > 0.5
    assert env.observation_space.contains(observation)
    # Lost in step k, it is charged 10.35 for that step and for each of the 2000 - k that remain.
    assert rewards[-1] == pytest.approx(-10.35 * (1 + 2000 - len(rewards)))


def test_an_episode_that_is_over_waits_for_reset():
    scenario = dataclasses.replace(usm_gym.suite("operation")[0], duration=0.2, settle_time=0.1)
    env = gym.make("USM-Operation-v0").unwrapped
    env.reset(options={"scenario": scenario})
    for _ in range(10):
        *_, truncated, _ = env.step(np.zeros(5, np.float32))
    assert truncated
    with pytest.raises(gym.error.ResetNeeded, match="over"):
        env.step(np.zeros(5, np.float32))
    env.reset()
    env.step(np.zeros(5, np.float32))


def test_a_state_that_is_not_finite_is_reported():
    env = gym.make("USM-Operation-v0", conditions={"integrator": "explicit"})
    env.reset(seed=0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for _ in range(200):
            observation, _, terminated, _, info = env.step(np.ones(5, np.float32))
            if terminated:
                break
    assert terminated
    assert info["diverged"] == 1
    assert np.isfinite(observation).all()
    assert np.isfinite(list(info.values())).all()


@pytest.mark.parametrize(
    ("action", "message"),
    [
        (np.zeros(4, np.float32), r"shape is \(4,\); allowed: \(5,\)"),
        (np.zeros((1, 5), np.float32), r"shape is \(1, 5\)"),
        (np.array([0, np.nan, 0, 0, 0], np.float32), "NaN"),
    ],
)
def test_bad_actions_are_refused(action, message):
    env = gym.make("USM-Operation-v0", disable_env_checker=True)
    env.reset(seed=0)
    with pytest.raises(ValueError, match=message):
        env.step(action)


def test_actions_beyond_the_bounds_saturate():
    outcomes = []
    for size in (1.0, 50.0, np.inf):
        env = gym.make("USM-Operation-v0")
        env.reset(seed=0)
        outcomes.append(env.step(np.full(5, size, np.float32)))
    assert (outcomes[0][0] == outcomes[1][0]).all()
    assert (outcomes[0][0] == outcomes[2][0]).all()
    assert outcomes[0][4]["thrust_effort"] == 20.0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"conditions": "stormy"}, "conditions is 'stormy'; allowed: ideal, field, basin, sea"),
        ({"conditions": {"noise": 1.0}}, "noise"),
        ({"conditions": {"position_noise": -1.0}}, "greater than or equal to 0"),
        ({"robot": {"links": 1}}, "links is 1"),
        ({"robot": {"thrusters": ()}}, "thrusters is \\(\\)"),
        ({"robot": 3}, "robot is 3"),
        ({"conditions": {"thruster_limit": 5000.0}}, "thruster_limit"),
        ({"render_mode": "holographic"}, "render_mode"),
    ],
)
def test_bad_arguments_are_refused(arguments, message):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with pytest.raises(ValueError, match=message):
            gym.make("USM-Operation-v0", **arguments)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"scenario": "hard"}, "scenario is 'hard'; allowed: nominal, table1"),
        ({"scenarios": "nominal"}, "options"),
        ({"scenario": 3}, "scenario is 3"),
        ({"scenario": {"mode": "torpedo"}}, "mode"),
        ({"scenario": {"noise_seed": "7"}}, "noise_seed"),
        ({"scenario": {"path": {"speed": "fast"}}}, "speed"),
        ({"scenario": {"inspection": {"bending_joints": 16}}}, "bending_joints is 16"),
    ],
)
def test_bad_options_are_refused(options, message):
    env = gym.make("USM-Operation-v0")
    with pytest.raises(ValueError, match=message):
        env.reset(options=options)


def test_options_survive_the_spec():
    arguments = {"conditions": {"thruster_limit": 12.0, "coefficient_range": [0.9, 1.1]}}
    spec = gym.make("USM-Operation-v0", **arguments).spec
    env = gym.make(gym.envs.registration.EnvSpec.from_json(spec.to_json()))
    assert env.unwrapped.conditions.thruster_limit == 12.0
    assert env.unwrapped.conditions.coefficient_range == (0.9, 1.1)


def test_a_scenario_brings_its_own_conditions():
    scenario = usm_gym.suite("operation-ideal")[0]
    env = gym.make("USM-Operation-v0", conditions="basin")
    for given in (scenario, scenario.to_dict(), json.loads(json.dumps(scenario.to_dict()))):
        env.reset(options={"scenario": given})
        assert env.unwrapped.scenario == scenario
    assert env.unwrapped.nominal.thruster_time_constant == 0.0


def test_nominal_knowledge_holds_no_truth():
    env = gym.make("USM-Operation-v0", conditions="basin")
    knowledge = []
    for seed in (0, 1):
        env.reset(seed=seed)
        knowledge.append(env.unwrapped.nominal)
    assert knowledge[0] == knowledge[1]
    assert knowledge[0].robot == usm_gym.Robot()


def test_other_robots_are_environments_too():
    thrusters = [
        {"link": 1, "direction": "axial"},
        {"link": 1, "direction": "normal"},
        {"link": 3, "direction": "normal"},
    ]
    env = gym.make("USM-Operation-v0", robot={"links": 4, "thrusters": thrusters})
    assert env.action_space.shape == (3,)
    env.reset(options={"scenario": "nominal"})
    assert env.unwrapped.scenario.inspection.bending_joints == 2
    assert rollout(env, 500)[-1][2]["diverged"] == 0


def test_the_documentation_holds_the_table_of_the_observation():
    env = gym.make("USM-Operation-v0").unwrapped
    for name in env.layout.slices:
        assert f"`{name}`" in type(env).__doc__
    assert "OBSERVATION_TABLE" not in type(env).__doc__
