"""A spatial robot is refused where it makes no sense, in one line that names the field."""

from typing import Any

import numpy as np
import pytest
from support.space import state_of, wrench_of
from support.spatial_swimming import ROBOTS

from usm_gym import SpatialRobot
from usm_gym.robots import spatial_robot_of
from usm_gym.simulation import Simulation
from usm_gym.spatial_robot import EELY, EELY_NEUTRAL, EELY_THRUSTERS
from usm_gym.task.spatial_sampling import nominal_in_space

THRUSTERS = [
    {"link": each.link, "position": each.position, "direction": each.direction}
    for each in EELY_THRUSTERS
]
LINKS = [{"length": link.length, "keel": link.keel} for link in EELY.links]


def with_thruster(**fields: Any) -> dict[str, Any]:
    """Fields of a robot one of whose thrusters is another."""
    return {"thrusters": [*THRUSTERS[:2], THRUSTERS[2] | fields, *THRUSTERS[3:]]}


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"joint_axes": [(0, 0.6, 0.6)] * 8}, r"joint_axes, joint 1 is \(0.0, 0.6, 0.6\).*unit"),
        ({"joint_axes": [(0, 0, 2)] * 8}, "joint_axes.*less than or equal to 1"),
        ({"joint_axes": [(0.0, 0.0, 1.0)] * 7}, "joint_axes is .*; allowed: 8 axes"),
        ({"joint_axes": [(0.0, 1.0)] * 8}, "joint_axes"),
        (with_thruster(direction=(1.0, 1.0, 0.0)), "direction of the thruster on link 5.*unit"),
        (with_thruster(link=10), "thrusters, number 3 is 10; allowed: links 1 to 9"),
        (with_thruster(link=0), "link is 0"),
        (with_thruster(position=(0.81, 0.0, 0.0)), r"thrusters, number 3, position.*from 0 to 0.8"),
        (with_thruster(position=(-0.01, 0.0, 0.0)), "thrusters, number 3, position.*on its link"),
        (with_thruster(position=(0.2, 0.3, 0.4)), "thrusters, number 3, position.*up to 0.45"),
        (with_thruster(side="left"), "side"),
        ({"links": [{"length": 0.1, "keel": 0.1}] * 9}, "keel is 0.1; allowed: 0 to the radius"),
        ({"links": LINKS[:8]}, "joint_axes is .*; allowed: 7 axes"),
        ({"links": [{"length": 0.0}] * 9}, "length is 0.0"),
        ({"links": [{"length": 0.1, "mass": 0.0}] * 9}, "mass is 0.0"),
        ({"links": [{"radius": 0.1}] * 9}, "length"),
        ({"thrusters": THRUSTERS[:4]}, "thrusters is .*at least 5 items"),
        ({"added_mass_along": -0.1}, "added_mass_along is -0.1"),
        ({"gravity": float("nan")}, "gravity is nan"),
        ({"tail": 1.0}, "tail is 1.0"),
    ],
)
def test_what_makes_no_sense_is_named(fields: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message) as refusal:
        spatial_robot_of(fields)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("lacking", ["pitch", "yaw", "height", "course"])
def test_a_layout_that_cannot_hold_the_robot_is_refused_with_its_singular_values(
    lacking: str,
) -> None:
    middle = {"link": 5, "position": (0.4, 0.0, 0.0)}
    ahead, left, up = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    # What else there is would hold all the rest.
    sides = {
        "pitch": [(3, left), (7, left), (5, up), (5, up), (5, ahead)],
        "yaw": [(3, up), (7, up), (5, left), (5, left), (5, ahead)],
        "height": [(3, left), (7, left), (5, left), (5, ahead), (5, ahead)],
        "course": [(3, left), (7, left), (3, up), (7, up), (5, up)],
    }[lacking]
    at = {3: 0.3, 5: 0.4, 7: 0.3}
    thrusters = [
        middle | {"link": link, "position": (at[link], 0.0, 0.0), "direction": side}
        for link, side in sides
    ]
    with pytest.raises(ValueError, match=r"thrusters is .*singular values") as refusal:
        SpatialRobot(thrusters=thrusters)  # type: ignore[arg-type]
    text = str(refusal.value)
    assert "\n" not in text
    shown = text.partition("values ")[2].partition("'")[0].split(", ")
    assert len(shown) == 5
    assert float(shown[-1]) < 1e-3 < float(shown[0])


def test_names_and_fields_make_robots() -> None:
    assert spatial_robot_of(None) == spatial_robot_of("eely") == SpatialRobot()
    assert spatial_robot_of("eely-neutral") == EELY_NEUTRAL
    heavier = spatial_robot_of({"links": [link | {"mass": 12.0} for link in LINKS]})
    assert heavier.total_mass == pytest.approx(108.0)
    for name in ("paper", "snake"):
        with pytest.raises(ValueError, match="allowed: eely, eely-neutral"):
            spatial_robot_of(name)


@pytest.mark.parametrize("name", ["eely", "eely-uneven", "8 links"])
def test_the_straight_body_is_as_it_says(name: str) -> None:
    robot = ROBOTS[name]
    state = state_of(Simulation([nominal_in_space("torpedo3d", robot=robot)]))
    units = np.eye(len(robot.thrusters))
    expected = np.transpose([wrench_of(robot, state, unit) for unit in units])
    np.testing.assert_allclose(robot.straight_allocation(), expected, atol=1e-12)
    displaced = [1000.0 * np.pi * link.radius**2 * link.length for link in robot.links]
    np.testing.assert_allclose(robot.displaced_masses, displaced)
    np.testing.assert_allclose(EELY_NEUTRAL.masses, EELY.displaced_masses)
