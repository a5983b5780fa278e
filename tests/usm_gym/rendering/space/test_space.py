"""Pictures of a spatial robot: where things are in them, what hides what, where jets blow."""

from dataclasses import replace
from functools import cache

import numpy as np
import pygame
import pytest

from usm_gym.rendering.panel import Panel
from usm_gym.rendering.space.camera import Camera, View, following, orbiting
from usm_gym.rendering.space.canvas import SCENE, SpatialCanvas
from usm_gym.rendering.space.mesh import joined, revolved
from usm_gym.rendering.space.paint import paint
from usm_gym.rendering.space.picture import Pose, SpatialPicture
from usm_gym.spatial_posture import centre_of_mass, link_poses
from usm_gym.spatial_robot import EELY

# From the right of the robot, x is to the right of the picture; nearly from above, y is up in it.
SIDE, ABOVE = (-np.pi / 2, 0.0), (-np.pi / 2, 1.5)
IDLE = np.zeros(7)
# Half as large as usual, which is faster.
SIDES = ((SCENE.top, SCENE.bottom), (SCENE.left, SCENE.right))
CANVAS = SpatialCanvas(320)


def picture(angles=(0.0,) * 8, **changes):
    """A level robot in still water, its centre of mass at the origin and on its reference."""
    rotations, centres = link_poses(EELY, (0, 0, 0), (1, 0, 0, 0), angles)
    centres = centres - centre_of_mass(EELY, rotations, centres)
    times = np.arange(0.0, 4.01, 0.1)
    path = np.stack([0.05 * (np.arange(0.0, 20.0, 0.1) - 4.0), *np.zeros((2, 200))], axis=1)
    made = SpatialPicture(
        robot=EELY,
        time=4.0,
        body=Pose(rotations, centres),
        wanted=Pose(rotations, centres),
        thrust=IDLE,
        limit=40.0,
        current=np.zeros(3),
        drift=np.zeros(3),
        path=path,
        reference=np.zeros(3),
        middle=np.zeros(3),
        mass=np.zeros(3),
        times=times,
        track=path[: len(times)],
        errors=np.zeros((len(times), 3)),
        max_error=np.zeros(3),
        duration=20.0,
    )
    return replace(made, **changes)


def scene(shown, azimuth, elevation):
    frame = CANVAS.draw(shown, "a robot", camera=orbiting((0, 0, 0), 4.5, azimuth, elevation))
    rows, columns = (slice(start // 2, stop // 2) for start, stop in SIDES)
    return frame[rows, columns].astype(int)


def where(mask):
    """Places of pixels, from the middle of the scene to the right and up, points, (k, 2)."""
    rows, columns = np.nonzero(mask)
    return np.stack([2 * columns - SCENE.width / 2, SCENE.height / 2 - 2 * rows], axis=1)


def place(point, azimuth, elevation):
    """Where a point in space is in the same places, (2,)."""
    camera = orbiting((0, 0, 0), 4.5, azimuth, elevation)
    return View(camera, (0, 0), SCENE.width, 0.1).see(np.asarray(point)) * (1, -1)


def head(shown, azimuth, elevation):
    """Middle of what is orange."""
    red, green, blue = np.moveaxis(scene(shown, azimuth, elevation), 2, 0)
    found = where((red - blue > 70) & (green > 0.6 * red))
    assert len(found) > 30
    return found.mean(axis=0)


@cache
def idle(view):
    return scene(picture(), *view)


def jet(number, share, view):
    """Pixels that change when a thruster pushes."""
    thrust = IDLE.copy()
    thrust[number - 1] = share
    pushing = scene(picture(thrust=thrust), *view)
    return where(np.abs(pushing - idle(view)).max(axis=2) > 8)


def test_a_joint_that_turns_moves_the_head_to_its_side():
    bent = np.zeros((2, 8))
    bent[0, 6], bent[1, 7] = 0.6, 0.6  # to the left; down
    straight = picture()
    for view, angles, direction in (
        (ABOVE, bent[0], 1),
        (ABOVE, -bent[0], -1),
        (SIDE, bent[1], -1),
        (SIDE, -bent[1], 1),
    ):
        rest, moved = head(straight, *view), head(picture(angles), *view)
        assert rest[0] > 100  # ahead, to the right
        assert direction * (moved - rest)[1] > 10
    # From ahead of it, left is right.
    ahead = [head(picture(angles), 0.2, 0.1) for angles in (-bent[0], bent[0])]
    assert ahead[1][0] - ahead[0][0] > 50


@pytest.mark.parametrize(
    ("number", "view", "flow"),
    [
        (1, SIDE, (0, -1)),
        (2, ABOVE, (0, -1)),
        (3, SIDE, (0, -1)),
        (4, ABOVE, (-1, 0)),
        (5, ABOVE, (-1, 0)),
        (6, ABOVE, (0, -1)),
        (7, SIDE, (0, -1)),
    ],
)
def test_jets_blow_against_the_force_and_are_longer_for_a_larger_one(number, view, flow):
    thruster = EELY.thrusters[number - 1]
    tail_end = picture().body.centres[thruster.link - 1] - (
        EELY.lengths[thruster.link - 1] / 2,
        0,
        0,
    )
    at = place(tail_end + thruster.position, *view)
    full, half, back = ((jet(number, share, view) - at) @ flow for share in (1.0, 0.5, -1.0))
    assert full.mean() > 10
    assert back.mean() < -10
    assert 5 < half.max() < full.max() - 10


def test_the_left_jet_is_on_the_left():
    assert jet(4, 1.0, ABOVE).mean(axis=0)[1] > 10
    assert jet(5, 1.0, ABOVE).mean(axis=0)[1] < -10


@pytest.mark.parametrize("order", [1, -1])
def test_what_is_nearer_hides_what_is_further_off(order):
    """Two crossed rods, whichever comes first in the mesh; the second is behind the first."""
    rod = [(-0.5, 0.0), (-0.5, 0.1), (0.5, 0.1), (0.5, 0.0)]
    red = revolved(rod, (255, 0, 0), (255, 0, 0), at=(0, -0.3, 0))
    blue = revolved(rod, (0, 0, 255), (0, 0, 255), at=(0, 0.3, 0), axis=(0, 0, 1))
    mesh = joined([red, blue][::order]).posed(np.eye(3)[np.newaxis], np.zeros((1, 3)))
    area = pygame.Rect(0, 0, 200, 200)
    for azimuth, near in ((-np.pi / 2, 0), (np.pi / 2, 2)):
        frame = pygame.Surface(area.size)
        panel = Panel(area, 1.0)
        view = View(orbiting((0, 0, 0), 3.0, azimuth, 0.1), area.center, area.width, 0.1)
        paint(panel, view, mesh, [])
        panel.show(frame)
        red_green_blue = frame.get_at(area.center)
        assert red_green_blue[near] > 100
        assert red_green_blue[2 - near] == 0


def test_a_view_is_a_pinhole_camera():
    """Against the law of perspective in axes that point along the view."""
    camera = Camera(np.array([1.0, -2.0, 0.5]), np.array([1.0, 3.0, 0.5]), np.radians(60))
    view = View(camera, (300.0, 200.0), 600.0, 0.1)
    random = np.random.default_rng(0)
    points = camera.position + random.uniform((-2, 0.5, -2), (2, 6, 2), (50, 3))
    right, ahead, up = (points - camera.position).T
    focus = 300 / np.tan(np.radians(30))
    expected = np.stack([300 + focus * right / ahead, 200 - focus * up / ahead], axis=1)
    np.testing.assert_allclose(view.see(points), expected)
    np.testing.assert_allclose(view.depth(points), ahead)


def test_a_line_that_passes_the_camera_ends_where_it_is_too_near():
    view = View(Camera(np.zeros(3), np.array([1.0, 0, 0])), (0, 0), 100.0, 0.1)
    line = np.array([[3.0, 1, 1], [1.0, 1, 1], [-1.0, 1, 1], [-2.0, 1, 1], [2.0, -1, 1]])
    first, last = view.see_line(line)
    ends = np.array([[0.1, 1, 1], line[4] + (line[3] - line[4]) * 1.9 / 4])
    np.testing.assert_allclose(first, view.see(np.stack([line[0], line[1], ends[0]])))
    np.testing.assert_allclose(last, view.see(np.stack([ends[1], line[4]])))


def test_the_track_is_drawn_where_the_centre_of_mass_was():
    track = np.zeros((41, 3))
    track[:, 0], track[:, 2] = np.linspace(-1.0, 0.0, 41), 0.4
    drawn, without = (scene(picture(track=each), *SIDE) for each in (track, track[-1:]))
    found = where(np.abs(drawn - without).max(axis=2) > 30)
    start, end = place(track[0], *SIDE), place(track[-1], *SIDE)
    assert found[:, 0].min() == pytest.approx(start[0], abs=3)
    assert found[:, 1].mean() == pytest.approx((start[1] + end[1]) / 2, abs=3)


def test_the_same_picture_has_the_same_bytes_at_any_size():
    shown = picture(thrust=np.linspace(-1, 1, 7), current=np.array([0.1, 0.05, 0.02]))
    for width in (160, 320):
        canvas, other = SpatialCanvas(width), SpatialCanvas(width)
        first = canvas.draw(shown, "a robot")
        assert first.shape == (width * 3 // 4, width, 3)
        other.draw(picture(np.full(8, 0.3), time=3.0), "another", camera=orbiting((1, 1, 1), 2.0))
        np.testing.assert_array_equal(other.draw(shown, "a robot"), first)


def test_the_camera_keeps_its_place_beside_the_middle():
    here, there = (following(picture(middle=np.array(at))) for at in ((0, 0, 0), (3.0, 1, -2)))
    np.testing.assert_allclose(there.position - here.position, (3, 1, -2))
    behind, left, above = here.position
    assert behind < 0
    assert left < 0
    assert above > 0


@pytest.mark.parametrize(
    "camera",
    [
        Camera(np.zeros(3), np.zeros(3)),
        Camera(np.array([0.0, 0, 3]), np.zeros(3)),
        Camera(np.array([0.0, 0, -3]), np.zeros(3)),
        Camera(np.array([0.3, 0.05, 0]), np.array([9.0, 0, 0])),
        Camera(np.array([-4.0, 0, 0]), np.array([-9.0, 0, 0])),
        Camera(np.array([-0.9, 0.2, 0.1]), np.zeros(3), np.radians(175)),
        Camera(np.array([1e6, 0, 1e5]), np.zeros(3), 1e-4),
    ],
    ids=["nowhere", "above", "below", "inside", "away", "wide", "far"],
)
def test_odd_cameras_and_lost_robots_are_drawn_without_a_fault(camera):
    shown = picture(thrust=np.linspace(-1, 1, 7), current=np.array([0.1, 0.05, 0.02]))
    away = shown.body._replace(centres=shown.body.centres + np.array((9, -9, 9)))
    lost = replace(shown, body=away, lost=True)
    canvas = SpatialCanvas(160)
    with np.errstate(all="raise", under="ignore"):
        for each in (shown, lost):
            canvas.draw(each, "a robot", camera=camera)
    view = View(camera, (0, 0), 600.0, 0.1)
    assert np.isfinite(view.see(np.concatenate([shown.body.centres, away.centres]))).all()
    assert np.isfinite(view.slopes(np.linspace(-300, 300, 7))).all()
