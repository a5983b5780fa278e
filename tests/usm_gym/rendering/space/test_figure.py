"""The drawing of the spatial robot: its signs are those of the robot's data."""

import dataclasses
import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest

from usm_gym.rendering.space.figure import spatial_robot_drawing
from usm_gym.spatial_posture import link_poses
from usm_gym.spatial_robot import EELY, EELY_NEUTRAL, Z

SVG = "{http://www.w3.org/2000/svg}"
# Forces and numbers of thrusters that nothing but the data can tell.
OTHER = dataclasses.replace(
    EELY,
    thrusters=tuple(
        dataclasses.replace(thruster, direction=tuple(-part for part in thruster.direction))
        for thruster in reversed(EELY.thrusters)
    ),
)


class Drawing:
    """Reads a drawing back; places have y upwards."""

    def __init__(self, robot):
        self.root = ET.fromstring(spatial_robot_drawing(robot))

    @property
    def description(self):
        return self.root.findtext(SVG + "desc")

    def part(self, name):
        (part,) = (group for group in self.root.iter(SVG + "g") if group.get("id") == name)
        return part

    def routes(self, name):
        """The points of a part's lines and shapes, one array each."""
        routes = [path.get("d") for path in self.part(name).iter(SVG + "path")]
        found = [re.findall(r"-?[\d.]+", route) for route in routes]
        return [np.array(numbers, float).reshape(-1, 2) * (1, -1) for numbers in found]

    def words(self, name):
        return ["".join(text.itertext()) for text in self.part(name).iter(SVG + "text")]

    def outlines(self, letter):
        """Outlines of the links in one of the views, tail first."""
        part = self.part(f"side-{letter}")
        shapes = [path for path in part if path.get("class") in ("body", "head")]
        found = [re.findall(r"-?[\d.]+", path.get("d")) for path in shapes]
        return [np.array(numbers, float).reshape(-1, 2) * (1, -1) for numbers in found]


@pytest.fixture(scope="module", params=[EELY, OTHER], ids=["eely", "other"])
def robot(request):
    return request.param


@pytest.fixture(scope="module")
def drawing(robot):
    return Drawing(robot)


def test_links_and_their_lengths_are_to_scale(robot, drawing):
    assert drawing.words("lengths")[:9] == [f"{length:g}" for length in robot.lengths]
    ticks = np.array([route[0, 0] for route in drawing.routes("lengths")[1:]])
    scale = np.ptp(ticks) / robot.lengths.sum()
    np.testing.assert_allclose(np.diff(ticks), scale * robot.lengths, atol=0.2)
    for letter in "yz":
        for outline, left, right in zip(
            drawing.outlines(letter), ticks[:-1], ticks[1:], strict=True
        ):
            assert left <= outline[:, 0].min() < left + 2.5
            assert right - 2.5 < outline[:, 0].max() <= right
            assert np.ptp(outline[:, 1]) == pytest.approx(2 * scale * 0.09, abs=0.3)


def test_arrows_of_forces_point_where_unit_forces_push(robot, drawing):
    forces = robot.straight_allocation()[:3].T
    for j, (thruster, force) in enumerate(zip(robot.thrusters, forces, strict=True), 1):
        from_above = abs(force[2]) < 0.5
        name = f"thruster-{j}"
        view = drawing.part("side-y" if from_above else "side-z")
        assert any(group.get("id") == name for group in view.iter(SVG + "g"))
        shaft, head = drawing.routes(name)[-2:]
        way = head[1] - shaft[0]
        expected = force[[0, 1 if from_above else 2]]
        np.testing.assert_allclose(way / np.linalg.norm(way), expected, atol=1e-3)
        assert drawing.words(name) == [str(j)]
        middle = np.mean(drawing.outlines("y" if from_above else "z")[thruster.link - 1], axis=0)
        scale = 512 / robot.lengths.sum()
        along = thruster.position[0] - robot.lengths[thruster.link - 1] / 2
        start = middle[0] + scale * along
        assert abs(shaft[0, 0] - start) < 12


@pytest.mark.parametrize(("letter", "joint"), [("y", 7), ("z", 8)])
def test_a_turned_joint_is_drawn_as_the_poses_turn_it(drawing, letter, joint):
    """The arrow, and the outline of the head."""
    angles = np.zeros(8)
    angles[joint - 1] = 0.1
    ahead = link_poses(EELY, (0, 0, 0), (1, 0, 0, 0), angles)[0][-1, :, 0]
    side = np.sign(ahead["xyz".index(letter)])
    name = f"turned-{letter}"
    assert drawing.words(name) == [f"φ{joint} > 0"]
    *ghosts, arc, tip = drawing.routes(name)
    assert side * (tip[1] - arc[0])[1] > 20
    assert side * (ghosts[-1].mean(axis=0) - drawing.outlines(letter)[-1].mean(axis=0))[1] > 8


def test_joints_are_shown_in_the_view_along_their_axis(drawing):
    for k, axis in enumerate(EELY.joint_axes, 1):
        view = drawing.part("side-y" if axis[2] else "side-z")
        assert any(group.get("id") == f"joint-{k}" for group in view.iter(SVG + "g"))


def test_from_behind_left_is_left_and_the_centre_of_mass_is_below(robot, drawing):
    for j, thruster in enumerate(robot.thrusters, 1):
        if abs(thruster.direction[0]) > 0.5:
            centre, end = drawing.routes(f"behind-{j}")[0]
            assert (end - centre)[0] * thruster.position[1] < 0
    buoyancy, *_, mass = (
        np.array([float(disc.get("cx")), -float(disc.get("cy"))])
        for disc in drawing.part("section").findall(SVG + "circle")
    )
    assert mass[0] == buoyancy[0]
    assert mass[1] < buoyancy[1]
    assert "centre of mass, 3 cm lower" in drawing.words("section")
    assert "centres of mass lie below the axis" in drawing.description


def test_without_a_keel_the_centre_of_mass_is_that_of_buoyancy():
    drawing = Drawing(EELY_NEUTRAL)
    assert "centre of mass" in drawing.words("section")
    assert "centres of mass and of buoyancy lie on the axis" in drawing.description


def test_a_robot_whose_joints_all_turn_about_one_axis_is_drawn():
    upright = dataclasses.replace(EELY, joint_axes=8 * (Z,))
    assert Drawing(upright).words("turned-y") == ["φ8 > 0"]
