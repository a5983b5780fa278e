"""Policies are made by name, from nominal knowledge and nothing else."""

from dataclasses import fields, replace
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
import usm_baselines
from stable_baselines3.common.vec_env import DummyVecEnv
from usm_baselines import registry

from usm_gym import Water
from usm_gym.task.conditions import PRESETS
from usm_gym.task.nominal import Nominal
from usm_gym.task.sampling import named, sample

SCRIPTED = ("sta", "sta-explicit", "pd", "pd-mass", "pd-observer", "zero")
RIVALS = (
    *("pid", "ladrc", "dob", "indi", "smc", "gsta", "agsta"),
    *("lqg", "lqg-joints", "mpc", "mpc-limits", "heading"),
)


@pytest.fixture(autouse=True)
def _registry_put_back(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(registry, "_entries", dict(registry._entries))


class Probe:
    """A policy that keeps what it was made from."""

    def __init__(self, *args: Any, **gains: Any) -> None:
        self.args = args
        self.gains = gains

    def predict(self, observation: Any, state: Any = None, *_: Any, **__: Any) -> Any:
        return np.zeros(5, np.float32), state


def test_the_scripted_policies_are_there() -> None:
    assert {*SCRIPTED, *RIVALS} <= set(usm_baselines.ids())
    assert len(set(usm_baselines.ids())) == len(usm_baselines.ids())
    for id in usm_baselines.ids():
        law = registry.base_of(id).rpartition("-")[2]
        assert registry.entry(id).privileged == (law in ("oracle", "informed"))
        assert "\n" not in registry.entry(id).summary


@pytest.mark.parametrize("id", [*SCRIPTED, *RIVALS])
def test_the_gains_of_a_space_are_gains_and_their_ranges_work(id: str) -> None:
    nominal = gym.make("USM-Operation-v0").unwrapped.nominal
    space = registry.entry(id).space
    assert len(space) <= 8
    assert bool(space) == (id not in ("sta-explicit", "heading", "zero"))
    for end in ("low", "high"):
        gains = {name: getattr(each, end) for name, each in space.items()}
        policy: Any = usm_baselines.make(id, nominal, **gains)
        assert all(getattr(policy.gains, name) == gain for name, gain in gains.items())
    if id not in ("sta", "pd", "pd-mass", "pd-observer"):  # the paper's gains may lie elsewhere
        default: Any = usm_baselines.make(id, nominal)
        for name, each in space.items():
            assert each.low <= getattr(default.gains, name) <= each.high


@pytest.mark.parametrize(
    ("mistyped", "meant"), [("sta-tund", "sta-tuned"), ("lqg-joint", "lqg-joints"), ("xyz", "")]
)
def test_an_unknown_name_is_answered_with_the_nearest(mistyped: str, meant: str) -> None:
    env = gym.make("USM-Operation-v0")
    with pytest.raises(ValueError, match=f"policy is '{mistyped}'.*`usm policies`") as error:
        usm_baselines.make(mistyped, env)
    assert ("did you mean" in str(error.value)) == bool(meant)
    assert meant in str(error.value)


def test_a_name_is_given_once() -> None:
    usm_baselines.register("mine", Probe, "a probe")
    with pytest.raises(ValueError, match="mine"):
        usm_baselines.register("mine", Probe, "another")
    with pytest.raises(ValueError, match="sta"):
        usm_baselines.register("sta", Probe, "an impostor")
    assert usm_baselines.ids()[-1] == "mine"
    assert registry.entry("mine").summary == "a probe"


def test_a_registration_is_forgotten_after_its_test() -> None:
    assert "mine" not in usm_baselines.ids()


def test_a_factory_is_given_nominal_knowledge_and_gains_only() -> None:
    usm_baselines.register("mine", Probe, "a probe")
    env = gym.make("USM-Operation-v0", conditions="basin")
    env.reset(seed=0)
    policy: Any = usm_baselines.make("mine", env, k_p=3.0)
    (nominal,) = policy.args
    assert type(nominal) is Nominal
    assert policy.gains == {"k_p": 3.0}
    assert {field.name for field in fields(nominal)} == {
        "robot",
        "control_period",
        "thruster_time_constant",
        "position_noise",
        "position_delay",
        "action_delay",
        "position_period",
        "velocity_period",
        "velocity_delay",
        "velocity_noise",
        "tail_angle_noise",
        "joint_angle_noise",
        "rate_noise",
        "thruster_dead_band",
        "joint_time_constant",
    }
    assert nominal.robot == env.unwrapped.robot
    assert nominal.control_period == 0.02
    assert nominal.thruster_time_constant == 0.15
    assert nominal.position_noise == 1e-3


def test_nominal_knowledge_tells_no_water_from_another() -> None:
    rng = np.random.default_rng(0)
    basin = {sample("operation", PRESETS["basin"], rng).nominal for _ in range(5)}
    assert len(basin) == 1
    wild = replace(
        named("nominal", "operation"), water=Water(current=(0.1, 0.1), coefficients=(1.5,) * 6)
    )
    assert wild.nominal == named("nominal", "operation").nominal


def test_environments_may_be_wrapped_vectorised_or_left_out() -> None:
    env = gym.make("USM-Operation-v0", conditions="basin")
    expected = env.unwrapped.nominal
    wrapped = gym.wrappers.TimeLimit(env, 10)
    vector = DummyVecEnv([lambda: gym.make("USM-Operation-v0", conditions="basin")] * 2)
    for given in (env, env.unwrapped, wrapped, vector, expected):
        made: Any = usm_baselines.make("sta", given)
        assert made.nominal == expected
    for wrong in (gym.make("CartPole-v1"), None, "USM-Operation-v0"):
        with pytest.raises(ValueError, match="env"):
            usm_baselines.make("sta", wrong)


@pytest.mark.parametrize("id", [*SCRIPTED, *RIVALS])
def test_unknown_and_impossible_gains_are_named(id: str) -> None:
    nominal = gym.make("USM-Operation-v0").unwrapped.nominal
    with pytest.raises(ValueError, match="k_q"):
        usm_baselines.make(id, nominal, k_q=1.0)
    if id == "zero":
        return
    for wrong in (-1.0, float("nan"), float("inf")):
        with pytest.raises(ValueError, match="heading_gain"):
            usm_baselines.make(id, nominal, heading_gain=wrong)
    with pytest.raises(ValueError, match="heading_gain"):
        usm_baselines.make(id, nominal, heading_gain="stiff")
    with pytest.raises(ValueError, match="observer_gain"):
        usm_baselines.make(id, nominal, observer_gain=0.0)


@pytest.mark.parametrize("id", SCRIPTED[:-1])
def test_gains_are_taken(id: str) -> None:
    nominal = gym.make("USM-Operation-v0").unwrapped.nominal
    given: Any = usm_baselines.make(id, nominal, heading_gain=1, observer_gain=20.0)
    default: Any = usm_baselines.make(id, nominal)
    assert given.gains == default.gains._replace(heading_gain=1.0, observer_gain=20.0)
    observation = np.zeros(94, np.float32)
    observation[89], observation[83] = 1.0, 2.0  # thruster limit, heading error
    moments = [policy.predict(observation)[0][1:] for policy in (given, default)]
    np.testing.assert_allclose(moments[1], 100.0 * moments[0], rtol=1e-5)
