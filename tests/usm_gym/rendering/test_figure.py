"""The drawing of the robot: every sign that it shows is the plant's."""

import dataclasses
import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest

import usm_gym
from usm_gym.rendering.figure import robot_drawing
from usm_gym.robot import Robot, Thruster
from usm_gym.simulation import Simulation
from usm_gym.task.conditions import PRESETS
from usm_gym.task.sampling import named
from usm_gym.task.scenario import Path
from usm_gym.task.water import Water

SVG = "{http://www.w3.org/2000/svg}"
PAPERS = Robot()
OTHER = Robot(
    links=7,
    link_length=0.2,
    thrusters=(
        Thruster(6, "normal"),
        Thruster(2, "axial"),
        Thruster(2, "normal"),
        Thruster(7, "axial"),
    ),
)


class Drawing:
    """Reads a drawing back; places have y upwards."""

    def __init__(self, robot):
        self.root = ET.fromstring(robot_drawing(robot))

    def part(self, name):
        (part,) = (group for group in self.root.iter(SVG + "g") if group.get("id") == name)
        return part

    def drawn(self, name):
        """The points of the first line of a part's arrow, and the tip of its head."""
        paths = self.part(name).iter(SVG + "path")
        solid = [path.get("d") for path in paths if path.get("stroke-dasharray") is None]
        return np.vstack([_points(solid[0]), _points(solid[1])[1]])

    def arrow(self, name):
        """Where a straight arrow begins, and its direction."""
        points = self.drawn(name)
        way = points[-1] - points[0]
        return points[0], way / np.linalg.norm(way)

    def turn(self, name):
        """From which angle to which an arrow turns, about a centre."""
        points = self.drawn(name)
        first, middle, last = points[0], points[len(points) // 2], points[-1]
        # As far from all three.
        sides = 2 * np.array([middle - first, last - first])
        squares = np.array([middle @ middle - first @ first, last @ last - first @ first])
        centre = np.linalg.solve(sides, squares)
        angles = np.unwrap(np.arctan2(*(points - centre).T[::-1]))
        return centre, angles[0], angles[-1]

    def links(self):
        """Centres of the links and their angles, rad, tail first."""
        places = [use.get("transform") for use in self.part("body").iter(SVG + "use")]
        numbers = np.array([re.findall(r"-?[\d.]+", place) for place in places], float)
        return numbers[:, :2] * (1, -1), np.radians(-numbers[:, 2])

    def discs(self, name):
        return [
            np.array([float(disc.get("cx")), -float(disc.get("cy"))])
            for disc in self.part(name).iter(SVG + "circle")
        ]


def _points(route):
    return np.array(re.findall(r"-?[\d.]+", route), float).reshape(-1, 2) * (1, -1)


@pytest.fixture(params=[PAPERS, OTHER], ids=["paper", "other"])
def robot(request):
    return request.param


@pytest.fixture
def drawing(robot):
    return Drawing(robot)


def swum(scenario, seconds):
    """A simulation some time into a scenario, without thrust."""
    simulation = Simulation([scenario])
    idle = np.zeros((1, len(scenario.body.thrusters)), np.float32)
    for _ in range(round(seconds / scenario.conditions.control_period)):
        simulation.step(idle)
    return simulation


def test_links_are_numbered_from_the_tail_and_hang_together(robot, drawing):
    centres, angles = drawing.links()
    numbers = [text.text for text in drawing.part("body").iter(SVG + "text")]
    assert numbers[: robot.links] == [str(i) for i in range(1, robot.links + 1)]
    along = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    ways, steps = np.diff(centres, axis=0), along[:-1] + along[1:]
    scale = (ways * steps).sum() / (steps**2).sum()
    np.testing.assert_allclose(ways, scale * steps, atol=0.2)
    mass = drawing.discs("error")[1]
    np.testing.assert_allclose(centres.mean(axis=0), mass, atol=0.1)


def test_the_posture_is_the_one_to_which_the_joints_move(robot, drawing):
    """A positive deflection, after the joints have followed it."""
    _, angles = drawing.links()
    scenario = named("nominal", "operation", PRESETS["ideal"], robot)
    theta = swum(scenario, 19.0).read("theta")[0]
    np.testing.assert_allclose(-np.diff(angles), -np.diff(theta), atol=np.radians(0.3))
    centre, tail, head = drawing.turn("deflection")
    assert head - tail == pytest.approx(theta[-1] - theta[0], abs=np.radians(1.5))
    np.testing.assert_allclose(centre, drawing.links()[0][-1], atol=1.5)


def test_positive_thrust_accelerates_along_the_arrow(robot, drawing):
    """With next to no water, the acceleration of the centre of mass is the force over the mass."""
    centres, angles = drawing.links()
    free = dataclasses.replace(robot, water_density=1e-3)
    still = np.zeros(robot.links)
    for j, thruster in enumerate(robot.thrusters):
        force = np.zeros(len(robot.thrusters))
        force[j] = free.total_mass
        _, acceleration = usm_gym.accelerations(free, angles, still, (0, 0), still[1:], force)
        start, ahead = drawing.arrow(f"thruster-{j + 1}")
        np.testing.assert_allclose(ahead, acceleration, atol=0.01)
        arm = centres[thruster.link - 1] - start
        assert abs(arm[0] * ahead[1] - arm[1] * ahead[0]) < 0.5  # through the link's centre
        assert drawing.part(f"thruster-{j + 1}").find(SVG + "text").text == str(j + 1)


def test_angles_turn_as_the_plant_turns(drawing):
    """Theta anticlockwise from x, with t and n as the link's axes; phi as a positive torque."""
    _, x = drawing.arrow("axes")
    np.testing.assert_allclose(x, (1, 0), atol=1e-6)
    _, first, theta = drawing.turn("theta")
    assert first == pytest.approx(0, abs=0.01)
    _, t = drawing.arrow("t")
    _, n = drawing.arrow("n")
    np.testing.assert_allclose(t, (np.cos(theta), np.sin(theta)), atol=0.02)
    np.testing.assert_allclose(n, (-np.sin(theta), np.cos(theta)), atol=0.02)
    _, _, theta_next = drawing.turn("theta-next")
    _, before, after = drawing.turn("phi")
    assert (before, after) == pytest.approx((theta, theta_next), abs=0.03)
    robot = Robot()
    torque = np.zeros(robot.links - 1)
    torque[7] = 1.0
    still = np.zeros(robot.links)
    turning, _ = usm_gym.accelerations(robot, still, still, (0, 0), torque, np.zeros(5))
    assert np.sign(after - before) == np.sign(turning[8] - turning[7])


def test_the_robot_drifts_along_the_current_and_errs_that_way():
    """A robot whose reference stays where it is."""
    drawing = Drawing(PAPERS)
    _, current = drawing.arrow("current")
    scenario = dataclasses.replace(
        named("nominal", "operation", PRESETS["ideal"]),
        path=Path(speed=0.0, amplitude=0.0),
        water=Water(current=tuple(0.05 * current)),
    )
    drift = swum(scenario, 1.0).error[0]
    assert (drift * current > 0).all()
    reference, mass = drawing.discs("error")[:2]
    start, error = drawing.arrow("error")
    np.testing.assert_allclose(start, reference, atol=0.1)
    np.testing.assert_allclose(
        error, (mass - reference) / np.linalg.norm(mass - reference), atol=0.02
    )


def test_the_reference_is_on_the_path():
    drawing = Drawing(PAPERS)
    points = _points(drawing.part("path").find(SVG + "path").get("d"))
    reference = drawing.discs("error")[0]
    assert np.hypot(*(points - reference).T).min() < 3.0
    assert (np.diff(points[:, 0]) > 0).all()  # towards the arrow's tip, as time goes by
