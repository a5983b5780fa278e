"""Pictures of robots whose head follows the path: where things are, in the plane and in space."""

import dataclasses
from functools import cache

import numpy as np
import pygame
import pytest
import usm_baselines

from usm_gym.rendering import canvas
from usm_gym.rendering.comparison import COLOURS, Caption, Comparison
from usm_gym.rendering.depiction import BENT_METRE, BENT_METRE_OF_ROW, depiction_of
from usm_gym.rendering.look import INK, REFERENCE, TRAIL
from usm_gym.rendering.row import MIDDLE_OF_SCENE
from usm_gym.rendering.scene import OUTLINE
from usm_gym.rendering.space.camera import View, following
from usm_gym.rendering.space.canvas import SCENE
from usm_gym.simulation import Simulation
from usm_gym.spatial_posture import centre_of_mass
from usm_gym.task.head_sampling import nominal_head, sample_head
from usm_gym.task.modes import presets_of

MODES = ("head", "head3d")


def scenario_of(mode):
    return dataclasses.replace(nominal_head(mode), duration=8.0, settle_time=1.0)


@cache
def swum(mode, steps=300):
    """A simulation some steps into an episode, and a picture of it."""
    scenario = scenario_of(mode)
    simulation, recorder = Simulation([scenario]), depiction_of(scenario.body).recorder()
    policy, state = usm_baselines.make("rates-pd", scenario.nominal), None
    for _ in range(steps):
        recorder.note(simulation)
        action, state = policy.predict(simulation.observation, state)
        simulation.step(action)
    return simulation, recorder.picture(simulation)


def tip(mode, picture):
    """The end of the head, m."""
    centre = picture.body.centres[-1]
    if mode == "head3d":
        return centre + picture.robot.lengths[-1] / 2 * picture.body.rotations[-1, :, 0]
    angle = picture.body.angles[-1]
    return centre + picture.robot.half_length * np.array([np.cos(angle), np.sin(angle)])


def near(frame, at, colour, within=12):
    """How many pixels around a place, column and row, have a colour."""
    column, row = np.rint(at).astype(int)
    part = frame[row - within : row + within, column - within : column + within]
    return int((np.abs(part.astype(int) - colour).max(axis=2) <= 6).sum())


@pytest.mark.parametrize("mode", MODES)
def test_a_picture_is_the_simulations(mode):
    simulation, picture = swum(mode)
    assert picture.follower == "head"
    np.testing.assert_allclose(tip(mode, picture), picture.track[-1], atol=1e-9)
    np.testing.assert_array_equal(picture.errors[-1], simulation.error[0])
    position = simulation.read("position")[0]
    if mode == "head":
        mass = picture.body.centres.mean(axis=0)
        np.testing.assert_allclose(mass, position, atol=1e-12)
        assert picture.reference is None
    else:
        mass = centre_of_mass(picture.robot, *picture.body)
        np.testing.assert_allclose(picture.body.centres[4], position, atol=1e-9)
        assert picture.wanted is None
    np.testing.assert_allclose(picture.mass, mass, atol=1e-9)
    assert np.linalg.norm(mass) < 0.02  # the body stays at the station
    assert np.linalg.norm(picture.track[-1]) > 0.5
    np.testing.assert_array_equal(picture.middle, np.zeros(len(mass)))


def test_body_and_figure_are_in_the_frame_in_the_plane():
    alone, row = canvas.SCENE, pygame.Rect(0, 0, 452, 122)
    room = [
        (np.array([alone.width, alone.height]) / 2 / BENT_METRE,) * 2,
        (
            np.array(MIDDLE_OF_SCENE) / BENT_METRE_OF_ROW,
            (row.size - np.array(MIDDLE_OF_SCENE)) / BENT_METRE_OF_ROW,
        ),
    ]
    for points in shown("head"):
        for before, behind in room:
            assert (points > -before).all()
            assert (points < behind).all()


def test_body_and_figure_are_in_the_frame_in_space():
    for points in shown("head3d"):
        assert (np.abs(points) < np.array(SCENE.size) / 2).all()


def shown(mode):
    """What is to be seen of some episodes at their start, from the middle of the view."""
    stream = np.random.default_rng(0)
    for _ in range(20):
        scenario = sample_head(mode, presets_of(mode)["field"], stream)
        picture = depiction_of(scenario.body).recorder().picture(Simulation([scenario]))
        points = np.concatenate([picture.body.centres, picture.path]) - picture.middle
        if mode == "head3d":
            points = View(following(picture), (0, 0), SCENE.width, 0.1).see(points)
        yield points


@pytest.mark.parametrize("mode", MODES)
def test_head_goal_and_centre_of_mass_have_their_marks(mode):
    _, picture = swum(mode)
    frame = depiction_of(scenario_of(mode).body).canvas().draw(picture, "a robot")

    def at(point):
        if mode == "head":
            return canvas.SCENE.center + BENT_METRE * point * (1, -1)
        return View(following(picture), SCENE.center, SCENE.width, 0.1).see(point)

    assert near(frame, at(picture.track[-1]), TRAIL, 4) > 25
    assert near(frame, at(picture.path[300]), REFERENCE) > 10
    assert near(frame, at(picture.mass), INK, 8) > 40
    assert near(frame, at(picture.mass), TRAIL) == 0
    assert not near(frame, (320, 190), OUTLINE, 130)


@pytest.mark.parametrize("mode", MODES)
def test_policies_are_compared_by_their_heads(mode):
    _, picture = swum(mode)
    other = dataclasses.replace(picture, follower="centre of mass")
    captions = [Caption("first"), Caption("second")]
    frames = [
        Comparison(480, captions, scenario_of(mode), [each] * 2, 1.0).draw([each] * 2)
        for each in (picture, other)
    ]
    assert not near(frames[0], (240, 37), OUTLINE, 37)
    assert near(frames[1], (240, 37), OUTLINE, 37)
    lens = [frame[118:240, 355:] for frame in frames]
    counts = [(np.abs(each.astype(int) - COLOURS[0]).max(axis=2) <= 6).sum() for each in lens]
    assert counts[0] > counts[1]  # a dot in the policy's colour
