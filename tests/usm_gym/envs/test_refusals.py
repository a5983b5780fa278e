"""What the environments refuse: bad actions, bad arguments and bad options, in one line each."""

import warnings

import gymnasium as gym
import numpy as np
import pytest

import usm_gym

PLANE, SPACE = "USM-Operation-v0", "USM-Operation3D-v0"


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


@pytest.mark.parametrize(
    ("id", "arguments", "message"),
    [
        *(
            (id, *refused)
            for id in (PLANE, SPACE)
            for refused in (
                ({"conditions": "stormy"}, "conditions is 'stormy'; allowed: ideal, field, basin"),
                ({"conditions": {"noise": 1.0}}, "noise"),
                ({"conditions": {"position_noise": -1.0}}, "greater than or equal to 0"),
                ({"conditions": {"thruster_limit": 5000.0}}, "thruster_limit"),
                ({"robot": {"thrusters": ()}}, "thrusters is \\(\\)"),
                ({"robot": 3}, "robot is 3"),
                ({"mode": "diving"}, "mode is 'diving'; allowed: operation"),
            )
        ),
        (PLANE, {"robot": {"links": 1}}, "links is 1"),
        (PLANE, {"robot": "eely"}, "robot is 'eely'; allowed: paper$"),
        (PLANE, {"mode": "operation3d"}, "mode is 'operation3d'; allowed: operation or torpedo"),
        (PLANE, {"render_mode": "holographic"}, "render_mode"),
        (SPACE, {"robot": {"links": ()}}, "links is \\(\\)"),
        (SPACE, {"robot": "paper"}, "robot is 'paper'; allowed: eely, eely-neutral$"),
        (SPACE, {"mode": "operation"}, "mode is 'operation'; allowed: operation3d or torpedo3d"),
    ],
)
def test_bad_arguments_are_refused(id, arguments, message):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with pytest.raises(ValueError, match=message) as refusal:
            gym.make(id, **arguments)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    ("id", "options", "message"),
    [
        (PLANE, {"scenario": "hard"}, "scenario is 'hard'; allowed: nominal, table1"),
        (SPACE, {"scenario": "table1"}, "scenario is 'table1'; allowed: nominal$"),
        *(
            (id, *refused)
            for id in (PLANE, SPACE)
            for refused in (
                ({"scenarios": "nominal"}, "options"),
                ({"scenario": 3}, "scenario is 3"),
                ({"scenario": {"noise_seed": "7"}}, "noise_seed"),
                ({"scenario": {"path": {"speed": "fast"}}}, "speed"),
            )
        ),
        (PLANE, {"scenario": {"mode": "torpedo"}}, "mode"),
        (SPACE, {"scenario": {"mode": "torpedo"}}, "mode is 'torpedo'"),
        (SPACE, {"scenario": {"mode": "torpedo3d"}}, "the scenario's mode is 'torpedo3d'"),
        (PLANE, {"scenario": usm_gym.suite("operation3d")[0]}, "scenario is SpatialScenario"),
        (SPACE, {"scenario": usm_gym.suite("operation")[0]}, "scenario is Scenario"),
        (SPACE, {"scenario": usm_gym.suite("operation3d-neutral")[0]}, "the scenario's robot"),
        (PLANE, {"scenario": {"inspection": {"bending_joints": 16}}}, "bending_joints is 16"),
        (SPACE, {"scenario": {"scan": {"bending_joints": 9}}}, "bending_joints is 9"),
        (
            SPACE,
            {"scenario": {"scan": {"bending_joints": 1}}},
            r"pans is \(0.8, -0.8, 0.0\).*joints",
        ),
        (SPACE, {"scenario": {"thruster_gains": [1.0] * 5}}, "thruster_gains.*7 thrusters"),
        (SPACE, {"scenario": {"water": {"link_factors": [1.0] * 8}}}, "link_factors.*9 links"),
    ],
)
def test_bad_options_are_refused(id, options, message):
    env = gym.make(id)
    with pytest.raises(ValueError, match=message) as refusal:
        env.reset(options=options)
    assert "\n" not in str(refusal.value)
