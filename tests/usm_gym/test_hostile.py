"""Hostile input: constructors, environments and their calls answer or raise ValueError."""

import copy
import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from support.spatial_swimming import ROBOTS
from support.strategies import ANYTHING, NUMBERS, almost_fields, fields_in_range

import usm_gym
from usm_gym import (
    Conditions,
    Inspection,
    Link,
    Path,
    Robot,
    Scan,
    Scenario,
    SpatialPath,
    SpatialRobot,
    SpatialScenario,
    SpatialThruster,
    SpatialWater,
    SpatialWave,
    Thruster,
    Water,
    Wave,
)
from usm_gym.envs.usm import USMEnv, USMVectorEnv
from usm_gym.envs.usm3d import USM3DEnv, USM3DVectorEnv
from usm_gym.robots import robot_of, spatial_robot_of
from usm_gym.support.validation import QUOTED, SAID
from usm_gym.task.conditions import conditions_of
from usm_gym.task.scenario import MODES

# Physics steps times links that an example may take.
AFFORDABLE = 300_000
ROBOT = Robot()
NOMINAL = Scenario().nominal
CLASSES = [
    *(Robot, Thruster, Conditions, Path, Inspection, Water, Wave, Scenario),
    *(SpatialRobot, Link, SpatialThruster, SpatialPath, Scan, SpatialWater, SpatialWave),
    SpatialScenario,
]
both = pytest.mark.parametrize("cls", [Scenario, SpatialScenario])


@pytest.fixture(scope="module", autouse=True)
def compiled():
    """Compile the kernels, which takes longer than an example may."""
    spatial = USM3DEnv("operation3d"), USM3DVectorEnv(3, "operation3d")
    for world in (USMEnv("operation"), USMVectorEnv(3, "operation"), *spatial):
        world.reset(seed=0)
        world.step(np.zeros(world.action_space.shape))
    usm_gym.linearise(NOMINAL)
    links = np.zeros(16)
    usm_gym.accelerations(ROBOT, links, links, links[:2], links[:15], links[:5])


def refused(call, *arguments, **options):
    """Whether a call refuses its arguments, shortly, on one line; what it gives otherwise."""
    try:
        return False, call(*arguments, **options)
    except ValueError as error:
        text = str(error)
        assert "\n" not in text
        assert len(text) <= SAID + 2 * QUOTED
        return True, None


@pytest.mark.parametrize("cls", CLASSES, ids=lambda cls: cls.__name__)
@given(data=st.data())
def test_constructors_refuse_or_make_what_json_gives_back(cls, data):
    given_ = data.draw(st.one_of(almost_fields(cls), fields_in_range(cls)))
    refused(cls, **{name: value for name, value in given_.items() if name.isidentifier()})


@given(value=st.one_of(ANYTHING, almost_fields(Conditions), fields_in_range(Conditions)))
def test_conditions_of_refuses_or_makes_conditions(value):
    no, conditions = refused(conditions_of, value)
    assert no or isinstance(conditions, Conditions)


@pytest.mark.parametrize(("cls", "made"), [(Robot, robot_of), (SpatialRobot, spatial_robot_of)])
@given(data=st.data())
def test_robot_of_refuses_or_makes_a_robot(cls, made, data):
    value = data.draw(st.one_of(ANYTHING, almost_fields(cls), fields_in_range(cls)))
    no, robot = refused(made, value)
    assert no or isinstance(robot, cls)


@both
@given(data=st.data())
def test_from_dict_refuses_or_makes_what_json_gives_back(cls, data):
    value = data.draw(st.one_of(ANYTHING, almost_fields(cls), fields_in_range(cls)))
    no, scenario = refused(cls.from_dict, value)
    if not no:
        assert cls.from_dict(json.loads(json.dumps(scenario.to_dict()))) == scenario


def affordable(robot, scenario, periods):
    steps = min(periods, scenario.steps) * scenario.conditions.substeps
    links = robot.links if isinstance(robot, Robot) else len(robot.links)
    return steps * links <= AFFORDABLE and scenario.steps <= 100_000


def spatial_bodies():
    """Robots in space: the shape of one that there is, all other numbers within their ranges."""
    fixed = ("links", "joint_axes", "thrusters")
    numbers = fields_in_range(SpatialRobot).map(
        lambda fields: {name: fields[name] for name in fields if name not in fixed}
    )
    shapes = st.sampled_from(list(ROBOTS.values()))
    mass = st.sampled_from([None, 1e-3, 1.0, 1e5])
    return st.builds(
        lambda shape, numbers, mass: replace(
            shape, links=tuple(replace(link, mass=mass) for link in shape.links), **numbers
        ),
        shapes,
        numbers,
        mass,
    )


def brief(draw, fields):
    """Let an episode be short, of whole control periods."""
    substeps = draw(st.integers(1, 40))
    conditions = fields.setdefault("conditions", {})
    step = conditions.setdefault("physics_step", 1e-3)
    conditions["control_period"] = step * substeps
    fields["duration"] = step * substeps * draw(st.integers(1, 60))
    soon = st.floats(0.0, fields["duration"])
    return sorted(draw(st.lists(soon, max_size=4, unique=True)))


@st.composite
def swims(draw, cls):
    """A robot, a scenario for it and forces, all within their ranges."""
    fields, angle = draw(fields_in_range(cls)), st.floats(-100, 100)
    times = brief(draw, fields)
    if cls is Scenario:
        no, robot = refused(robot_of, draw(fields_in_range(Robot)))
        assume(not no)
        motion, names, joints = "inspection", ["deflections"], robot.links - 1
    else:
        robot = draw(spatial_bodies())
        motion, names, joints = "scan", ["pans", "tilts"], len(robot.joint_axes)
        fields["robot"] = robot
        fields["thruster_gains"] = ()
        fields.setdefault("water", {})["link_factors"] = ()
    moving = fields.setdefault(motion, {})
    moving["bending_joints"] = draw(st.integers(1, joints))
    moving["times"] = times
    for name in names:
        moving[name] = [draw(angle) for _ in times]
    no, scenario = refused(cls.from_dict, fields)
    assume(not no)
    forces = draw(st.lists(st.floats(-1.0, 1.0), min_size=1, max_size=8))
    return robot, scenario, forces


@pytest.mark.parametrize(("cls", "made"), [(Scenario, USMEnv), (SpatialScenario, USM3DEnv)])
@given(data=st.data())
def test_whatever_is_in_range_swims_or_is_lost_with_finite_observations(cls, made, data):
    robot, scenario, forces = data.draw(swims(cls))
    assume(affordable(robot, scenario, 60))
    env = made(scenario.mode, scenario.conditions, robot)
    no, started = refused(env.reset, options={"scenario": scenario})
    if no:
        return
    observation, info = started
    ended = False
    for step in range(60):
        assert env.observation_space.contains(observation)
        assert np.isfinite(list(info.values())).all()
        if ended:
            break
        action = np.resize(np.array(forces[step % len(forces) :] + forces, np.float32), 64)
        observation, reward, lost, over, info = env.step(action[: len(robot.thrusters)])
        assert np.isfinite(reward)
        assert lost == info["diverged"]
        ended = lost or over


def odd_actions(shape):
    arrays = st.lists(NUMBERS, min_size=shape[-1], max_size=shape[-1])
    return st.one_of(ANYTHING, arrays, arrays.map(lambda each: [each] * shape[0]))


@pytest.fixture(scope="module")
def env():
    return USMEnv("operation")


@pytest.fixture(scope="module")
def envs():
    return USMVectorEnv(3, "operation")


@pytest.mark.filterwarnings("error")
@given(action=odd_actions((3, 5)))
def test_step_refuses_or_acts(env, envs, action):
    for world in (env, envs):
        world.reset(seed=0)
        before = world.simulation.snapshot()
        no, answer = refused(world.step, action)
        if no:
            after = world.simulation.snapshot()
            assert all((after.arrays[key] == before.arrays[key]).all() for key in before.arrays)
        else:
            assert np.isfinite(answer[0]).all()


def streams(world):
    generators = world._streams if isinstance(world, USMVectorEnv) else [world.np_random]
    return [copy.deepcopy(each.bit_generator.state) for each in generators]


SCENARIOS = st.one_of(
    st.sampled_from([None, "nominal", "table1"]),
    ANYTHING,
    almost_fields(Scenario),
    st.sampled_from([{"conditions": {"control_period": 0.04}}, {"mode": "torpedo"}]),
)
OPTIONS = st.one_of(
    ANYTHING,
    st.fixed_dictionaries({"scenario": SCENARIOS}),
    st.fixed_dictionaries(
        {"scenario": st.one_of(SCENARIOS, st.lists(SCENARIOS, min_size=3, max_size=3))},
        optional={"reset_mask": st.sampled_from([None, *map(np.array, ([True, False, True], 1))])},
    ),
)
SEEDS = st.one_of(st.none(), st.integers(0, 9), ANYTHING, st.lists(st.integers(-1, 3), max_size=3))


@given(seed=SEEDS, options=OPTIONS)
def test_a_refused_reset_changes_nothing(env, envs, seed, options):
    for world in (env, envs):
        world.reset(seed=0)
        before = world.simulation.snapshot(), streams(world), world.np_random_seed
        no, _ = refused(world.reset, seed=seed, options=options)
        if not no:
            continue
        after = world.simulation.snapshot(), streams(world), world.np_random_seed
        assert after[0].scenarios == before[0].scenarios
        for name, array in before[0].arrays.items():
            np.testing.assert_array_equal(after[0].arrays[name], array)
        assert after[1:] == before[1:]


@given(
    arguments=st.fixed_dictionaries(
        {},
        optional={
            "num_envs": ANYTHING,
            "threads": ANYTHING,
            "conditions": ANYTHING,
            "robot": ANYTHING,
            "autoreset_mode": ANYTHING,
            "mode": ANYTHING,
        },
    )
)
def test_environments_refuse_or_are_made(arguments):
    wanted = {"num_envs": 2, "mode": "operation", **arguments}
    if not isinstance(wanted["num_envs"], int) or wanted["num_envs"] < 1000:
        refused(USMVectorEnv, **wanted)
    del wanted["num_envs"]
    for other in ("threads", "autoreset_mode"):
        wanted.pop(other, None)
    no, env = refused(USMEnv, **wanted)
    assert no or env.mode in MODES


ARRAYS = st.one_of(ANYTHING, st.sampled_from([np.zeros(n) for n in (2, 5, 15, 16)]))


@pytest.mark.filterwarnings("error")
@given(arguments=st.lists(ARRAYS, min_size=5, max_size=6), form=st.one_of(st.none(), ANYTHING))
def test_functions_for_engineers_refuse_or_answer(arguments, form):
    options = {} if form is None else {"hydrodynamics": form}
    refused(usm_gym.accelerations, ROBOT, *arguments, **options)
    refused(usm_gym.linearise, arguments[0])
    refused(usm_gym.linearise, NOMINAL, heading=arguments[1], joint_angles=arguments[2])
    refused(usm_gym.Vehicle, arguments[0])
    vehicle = usm_gym.Vehicle(NOMINAL)
    seen, _ = vehicle.read(np.zeros(vehicle._world.layout.size, np.float32))
    refused(vehicle.read, arguments[0])
    refused(vehicle.inertia, arguments[1])
    refused(vehicle.linear_model, arguments[2])
    refused(vehicle.allocate, arguments[3], arguments[4], seen)
    refused(usm_gym.max_error, *arguments[:3])
    refused(usm_gym.suite, arguments[3])
    refused(usm_gym.evaluate, Still(), arguments[4])


class Still:
    """A policy that gives what no action is."""

    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        return observation, state
