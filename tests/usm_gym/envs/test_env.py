"""The environments as a user meets them: through `gym.make`."""

import dataclasses
import json
import re
import warnings

import gymnasium as gym
import numpy as np
import pytest
import usm_baselines
from support.episodes import NOISY

import usm_gym

PLANE, SPACE = "USM-Operation-v0", "USM-Operation3D-v0"
HEADS = ("USM-Head-v0", "USM-Head3D-v0")
IDS = (PLANE, "USM-Torpedo-v0", SPACE, "USM-Torpedo3D-v0", *HEADS)
both = pytest.mark.parametrize("id", [PLANE, SPACE])


def keys(env):
    """The keys of an info."""
    plane = len(env.unwrapped.world.axes) == 2
    axes, angles = ("xy", ["heading"]) if plane else ("xyz", ["pitch", "yaw", "roll"])
    if plane and "direction" in env.unwrapped.world.attitude:
        angles = ["direction", *angles]
    errors = [f"{kind}_{axis}" for kind in ("error", "max_error") for axis in axes]
    return {*errors, *(f"{angle}_error" for angle in angles), "thrust_effort", "diverged"}


def actions(env, steps, size=1.0):
    shape = steps, *env.action_space.shape
    return np.random.default_rng(1).uniform(-size, size, shape).astype(np.float32)


def rollout(env, steps, seed=0, policy_id="sta"):
    """Observations, rewards and errors of a seeded episode under a policy."""
    of_head = env.unwrapped.world.actions > env.unwrapped.world.thrusters
    policy = usm_baselines.make(f"rates-{policy_id}" if of_head else policy_id, env)
    observation, info = env.reset(seed=seed)
    state, record = None, [(observation, 0.0, info)]
    for _ in range(steps):
        action, state = policy.predict(observation, state)
        observation, reward, terminated, truncated, info = env.step(action)
        record.append((observation, reward, info))
        if terminated or truncated:
            break
    return record


@pytest.mark.parametrize(
    ("id", "options"),
    [(id, {}) for id in IDS]
    + [(id, {"render_mode": mode}) for id in IDS for mode in ("human", "rgb_array")]
    + [(SPACE, {"robot": "eely-neutral", "conditions": "sea"})],
)
def test_checkers_have_no_complaint(id, options, checkers):
    env = gym.make(id, **options).unwrapped
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for check in checkers:
            check(env)


@pytest.mark.parametrize("id", IDS)
def test_an_episode_is_truncated_at_its_duration(id):
    env = gym.make(id)
    record = rollout(env, 3000)
    assert len(record) - 1 == 2000
    assert all(set(info) == keys(env) for _, _, info in record)
    assert all(info["diverged"] == 0 for _, _, info in record)


@pytest.mark.parametrize(("id", "size"), [(PLANE, 94), (SPACE, 74), (IDS[3], 74)])
def test_observations_stay_inside_their_bounds_and_vary(id, size):
    env = gym.make(id, conditions=NOISY)
    observations = np.array([o for o, _, _ in rollout(env, 2000)])
    assert env.observation_space.shape == (size,)
    assert env.observation_space.dtype == observations.dtype == np.float32
    assert len(observations) == 2001
    assert (np.abs(observations) < env.observation_space.high).all()
    assert all(env.observation_space.contains(o) for o in observations)
    layout = env.unwrapped.layout
    constant = {"thruster_limit"}
    if id == SPACE:  # nothing but the reference 0 is asked of the attitude
        constant |= {"reference_rates"}
    if id == IDS[3]:  # a torpedo keeps its joints still
        constant |= {name for name in layout.slices if name.startswith("joint_reference")}
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


@both
def test_info_is_numpy_scalars_that_json_takes(id):
    env = gym.make(f"usm_gym:{id}")
    _, first = env.reset(seed=0)
    *_, info = env.step(env.action_space.high)
    for each in (first, info):
        assert {type(value) for value in each.values()} == {np.float64}
        assert json.loads(json.dumps(each)) == each


@pytest.mark.parametrize("id", IDS)
def test_equal_seeds_give_equal_bits_and_others_do_not(id):
    first, second, third = (rollout(gym.make(id), 300, seed) for seed in (7, 7, 8))
    for (a, r, i), (b, s, j) in zip(first, second, strict=True):
        assert (a == b).all()
        assert r == s
        assert i == j
    assert (first[-1][0] != third[-1][0]).any()


@pytest.mark.parametrize(
    ("id", "vector"),
    [
        (PLANE, gym.vector.SyncVectorEnv),
        (PLANE, gym.vector.AsyncVectorEnv),
        (SPACE, gym.vector.SyncVectorEnv),
    ],
)
def test_gymnasiums_vector_environments_give_the_same_bits(id, vector):
    def make():
        return gym.make(f"usm_gym:{id}")

    options = {"context": "spawn"} if vector is gym.vector.AsyncVectorEnv else {}
    envs = vector([make, make], **options)
    singles = [make(), make()]
    try:
        batch, _ = envs.reset(seed=[3, 4])
        single = [env.reset(seed=seed)[0] for env, seed in zip(singles, (3, 4), strict=True)]
        assert (batch == np.stack(single)).all()
        for action in actions(envs, 60):
            batch, rewards, *_ = envs.step(action)
            outcomes = [env.step(a) for env, a in zip(singles, action, strict=True)]
            assert (batch == np.stack([o[0] for o in outcomes])).all()
            assert rewards.tolist() == [o[1] for o in outcomes]
    finally:
        envs.close()


@pytest.mark.parametrize(("id", "conditions"), [(PLANE, "basin"), (SPACE, "basin"), (SPACE, "sea")])
def test_snapshot_and_restore_repeat_the_same_bits(id, conditions):
    env = gym.make(id, conditions=conditions)
    given = actions(env, 200, 0.2)
    env.reset(seed=5)
    for action in given[:100]:
        env.step(action)
    snapshot = env.unwrapped.snapshot()
    first = [env.step(action) for action in given[100:]]
    env.reset(seed=6)
    env.unwrapped.restore(snapshot)
    second = [env.step(action) for action in given[100:]]
    for a, b in zip(first, second, strict=True):
        assert (a[0] == b[0]).all()
        assert a[1:] == b[1:]


@pytest.mark.parametrize(("id", "worst"), [(PLANE, 10.35), (SPACE, 10.6)])
def test_a_lost_robot_ends_the_episode_with_a_finite_observation_and_the_bill(id, worst):
    env = gym.make(id)
    env.reset(options={"scenario": "nominal"})
    rewards = []
    while True:
        observation, reward, terminated, truncated, info = env.step(env.action_space.high)
        rewards.append(reward)
        if terminated or truncated:
            break
    assert terminated
    assert not truncated
    assert info["diverged"] == 1
    assert max(abs(info[f"error_{axis}"]) for axis in env.unwrapped.world.axes) > 0.5
    assert env.observation_space.contains(observation)
    # Lost in step k, it is charged so much for that step and for each of the 2000 - k that remain.
    assert rewards[-1] == pytest.approx(-worst * (1 + 2000 - len(rewards)))
    assert -worst < min(rewards[:-1])


def test_the_reward_is_that_of_the_documentation():
    for id, angles in ((PLANE, ["heading"]), (SPACE, ["pitch", "yaw"])):
        env = gym.make(id)
        env.reset(seed=0)
        limit, axes = env.unwrapped.conditions.thruster_limit, env.unwrapped.world.axes
        for action in actions(env, 40, 0.3):
            _, reward, *_, info = env.step(action)
            e = np.abs([info[f"error_{axis}"] for axis in axes])
            a = np.degrees(np.abs([info[f"{angle}_error"] for angle in angles]))
            expected = -10.0 * np.mean(e / (e + 0.02)) - 0.25 * np.sum(a / (a + 20.0))
            expected -= 0.1 * np.abs(action).mean()
            assert reward == pytest.approx(expected, rel=1e-6)
            effort = limit * np.abs(action).mean()
            assert info["thrust_effort"] == pytest.approx(effort, rel=1e-6)


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


@both
def test_a_state_that_is_not_finite_is_reported(id):
    env = gym.make(id, conditions={"integrator": "explicit"})
    env.reset(seed=0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for _ in range(200):
            observation, _, terminated, _, info = env.step(env.action_space.high)
            if terminated:
                break
    assert terminated
    assert info["diverged"] == 1
    assert np.isfinite(observation).all()
    assert np.isfinite(list(info.values())).all()


@both
def test_actions_beyond_the_bounds_saturate(id):
    outcomes = []
    for size in (1.0, 50.0, np.inf):
        env = gym.make(id)
        env.reset(seed=0)
        outcomes.append(env.step(size * env.action_space.high))
    assert (outcomes[0][0] == outcomes[1][0]).all()
    assert (outcomes[0][0] == outcomes[2][0]).all()
    assert outcomes[0][4]["thrust_effort"] == env.unwrapped.conditions.thruster_limit


@both
def test_options_survive_the_spec(id):
    arguments = {"conditions": {"thruster_limit": 12.0, "coefficient_range": [0.9, 1.1]}}
    spec = gym.make(id, **arguments).spec
    env = gym.make(gym.envs.registration.EnvSpec.from_json(spec.to_json()))
    assert env.unwrapped.conditions.thruster_limit == 12.0
    assert env.unwrapped.conditions.coefficient_range == (0.9, 1.1)


@pytest.mark.parametrize(("id", "suite"), [(PLANE, "operation"), (SPACE, "operation3d")])
def test_a_scenario_brings_its_own_conditions(id, suite):
    env = gym.make(id, conditions="basin")
    ideal = gym.make(id, conditions="ideal").unwrapped.conditions
    scenario = usm_gym.suite(suite)[0].under(ideal)
    for given in (scenario, scenario.to_dict(), json.loads(json.dumps(scenario.to_dict()))):
        env.reset(options={"scenario": given})
        assert env.unwrapped.scenario == scenario
    assert env.unwrapped.nominal.thruster_time_constant == 0.0


@both
def test_nominal_knowledge_holds_no_truth(id):
    env = gym.make(id, conditions="basin")
    knowledge = []
    for seed in (0, 1):
        env.reset(seed=seed)
        knowledge.append(env.unwrapped.nominal)
    assert knowledge[0] == knowledge[1]
    assert knowledge[0].robot == (usm_gym.Robot() if id == PLANE else usm_gym.SpatialRobot())


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


def test_other_robots_in_space_are_environments_too():
    links = [{"length": 0.6}] * 5
    axes = [(0.0, 0.0, 1.0), (0.0, 1.0, 0.0)] * 2
    ahead, left, up = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    places = [(2, left), (2, up), (4, left), (4, up), (3, ahead)]
    thrusters = [
        {"link": link, "position": (0.3, 0.0, 0.0), "direction": side} for link, side in places
    ]
    robot = {"links": links, "joint_axes": axes, "thrusters": thrusters}
    env = gym.make(SPACE, robot=robot)
    assert env.action_space.shape == (5,)
    env.reset(options={"scenario": "nominal"})
    assert env.unwrapped.scenario.scan.bending_joints == 2
    assert rollout(env, 500)[-1][2]["diverged"] == 0


@pytest.mark.parametrize(("id", "size"), [(PLANE, 94), (SPACE, 74)])
def test_the_documentation_holds_the_table_of_the_observation(id, size):
    env = gym.make(id).unwrapped
    said = type(env).__doc__
    rows = re.findall(r"\| (\d+)(?:-(\d+))? \| `(\w+)` \|", said)
    table = {name: slice(int(first), int(last or first) + 1) for first, last, name in rows}
    assert table == env.layout.slices
    assert f"`Box(float32)` of {size} numbers" in said
    assert "OBSERVATION_TABLE" not in said
