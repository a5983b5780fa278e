"""The residual task of the head: its base to the bit, single as vector, and what is corrected."""

import warnings

import gymnasium as gym
import numpy as np
import pytest
import usm_baselines
from usm_agents.residual.env import make_residual_vector_env

from usm_gym.task.modes import ALL_HEAD_MODES

IDS = {"head": "usm_agents:USM-HeadResidual-v0", "head3d": "usm_agents:USM-Head3DResidual-v0"}
PLAIN = {"head": "USM-Head-v0", "head3d": "USM-Head3D-v0"}


@pytest.mark.parametrize("mode", ALL_HEAD_MODES)
def test_checkers_have_no_complaint(checkers, mode):
    for check in checkers:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            # The wrapper is the environment here; unwrapping it would check the plain one.
            warnings.filterwarnings("ignore", message=".*different from the unwrapped version.*")
            check(gym.make(IDS[mode], disable_env_checker=True).env.env)


@pytest.mark.parametrize("mode", ALL_HEAD_MODES)
@pytest.mark.parametrize("action", ["head", "force"])
def test_a_zero_residual_is_the_base_to_the_bit(action, mode):
    base = "rates-lqg-joints"
    plain, residual = gym.make(PLAIN[mode]), gym.make(IDS[mode], base=base, action=action)
    policy = usm_baselines.make(base, plain)
    observation, _ = plain.reset(seed=2)
    residual.reset(seed=2)
    state, nothing = None, np.zeros(residual.action_space.shape, np.float32)
    for _ in range(200):
        chosen, state = policy.predict(observation, state)
        observation, reward, *_, info = plain.step(chosen)
        _, its_reward, *_, its_info = residual.step(nothing)
        assert its_reward == reward
        assert its_info == info


@pytest.mark.parametrize("mode", ALL_HEAD_MODES)
def test_a_vector_behaves_as_single_environments(mode):
    envs = make_residual_vector_env(3, mode, autoreset_mode="SameStep")
    singles = [gym.make(IDS[mode]) for _ in range(3)]
    seen, _ = envs.reset(seed=5)
    assert (seen == np.stack([env.reset(seed=5 + i)[0] for i, env in enumerate(singles)])).all()
    for actions in np.random.default_rng(0).uniform(-1, 1, (40, 3, 3)).astype(np.float32):
        seen, rewards, *_ = envs.step(actions)
        for env, its, one, reward in zip(singles, actions, seen, rewards, strict=True):
            expected, alone, *_ = env.step(its)
            assert (one == expected).all()
            assert reward == alone


@pytest.mark.parametrize("mode", ALL_HEAD_MODES)
def test_a_correction_moves_the_head_along_its_axis(mode):
    # Two episodes that differ in the correction alone; the law for the head is slow to undo it.
    for axis in range(3 if mode == "head3d" else 2):
        heads = []
        for size in (0.0, 1.0):
            law = usm_baselines.make("rates-sta", gym.make(PLAIN[mode]), head_gain=0.3)
            env = gym.make(IDS[mode], base=law)
            env.reset(seed=0)
            action = np.zeros(env.action_space.shape, np.float32)
            action[axis] = size
            for _ in range(50):
                env.step(action)
            heads.append(env.unwrapped.simulation.error[0].copy())
        moved = heads[1] - heads[0]
        assert np.argmax(np.abs(moved)) == axis
        assert 0.005 < moved[axis] < 0.03


@pytest.mark.parametrize("mode", ALL_HEAD_MODES)
def test_joints_can_be_the_agents_alone(mode):
    env = gym.make(IDS[mode], action="joints")
    env.reset(seed=0)
    joints = env.action_space.shape[0]
    rates = np.linspace(-1.0, 1.0, joints).astype(np.float32)
    for _ in range(3):
        env.step(rates)
    simulation = env.unwrapped.simulation
    largest = 0.2 * env.unwrapped.nominal.robot.joint_rate_limit
    np.testing.assert_allclose(simulation.read("joint_commands")[0], largest * rates, rtol=1e-6)


@pytest.mark.parametrize(
    ("id", "arguments", "allowed"),
    [
        (IDS["head"], {"base": "sta"}, "whose joints|law for the head"),
        (IDS["head"], {"action": "estimates"}, "a law that estimates by the plant"),
        ("usm_agents:USM-OperationResidual-v0", {"action": "head"}, "a law for the head"),
    ],
)
def test_what_does_not_fit_the_head_is_refused(id, arguments, allowed):
    with pytest.raises(ValueError, match=allowed):
        gym.make(id, **arguments)


@pytest.mark.parametrize("mode", ALL_HEAD_MODES)
def test_the_agent_sees_the_head_as_it_is(mode):
    # Without noise the navigator's position is the true one.
    env = gym.make(IDS[mode], conditions="ideal")
    env.reset(seed=0)
    for _ in range(100):
        seen, *_ = env.step(env.action_space.sample())
    layout, simulation = env.unwrapped.simulation.layout, env.unwrapped.simulation
    table = env.get_wrapper_attr("residual").layout
    shown = {name: seen[place] * table.scale[place] for name, place in table.slices.items()}
    plain = simulation.observation[0] * layout.scale
    np.testing.assert_allclose(shown["head_error"], simulation.error[0], atol=2e-5)
    for name in ("head_reference_velocity", "head_reference_acceleration", "joint_angles"):
        np.testing.assert_allclose(shown[name], plain[layout.slices[name]], rtol=1e-5, atol=1e-6)
    jacobian = np.empty((1, 3, env.unwrapped.nominal.robot.joints))
    simulation.world.jacobians(simulation.observation, jacobian)
    moved = jacobian[0, : len(shown["joints_velocity"])] @ plain[layout.slices["joint_rates"]]
    np.testing.assert_allclose(shown["joints_velocity"], moved, rtol=1e-4, atol=1e-6)
