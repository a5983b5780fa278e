"""Several policies in one picture: what its numbers and signs say, against the simulation."""

import dataclasses

import numpy as np
import pygame
import pytest

import usm_gym
from usm_gym.rendering.comparison import (
    COLOURS,
    Caption,
    Comparison,
    measured,
    scored_distances,
)
from usm_gym.rendering.depiction import depiction_of
from usm_gym.rendering.look import HEAD, WATER
from usm_gym.rendering.picture import drift, velocity
from usm_gym.rendering.space.camera import View, following
from usm_gym.rendering.space.row import SpatialRow
from usm_gym.simulation import Simulation
from usm_gym.task.conditions import PRESETS
from usm_gym.task.spatial_sampling import nominal_in_space
from usm_gym.task.water import Water

SCENARIO = dataclasses.replace(usm_gym.suite("operation-basin")[4], duration=3.0, settle_time=1.0)
IN_SPACE = dataclasses.replace(nominal_in_space("torpedo3d"), duration=3.0, settle_time=1.0)


def picture(steps, thrust=0.0, scenario=SCENARIO):
    """A picture after some control periods of constant thrust, and the errors on the way."""
    simulation, recorder = Simulation([scenario]), depiction_of(scenario.body).recorder()
    errors = []
    for _ in range(steps):
        recorder.note(simulation)
        errors.append(simulation.error[0].copy())
        simulation.step(np.full((1, simulation.world.thrusters), thrust))
    errors.append(simulation.error[0].copy())
    return recorder.picture(simulation), np.array(errors)


def where(frame, colour, tolerance=6):
    """Rows and columns in which a frame has a colour, (k, 2)."""
    return np.argwhere(np.abs(frame.astype(int) - colour).max(axis=2) <= tolerance)


def compared(pictures, width=480, scenario=SCENARIO):
    captions = [Caption(str(k), "position only") for k in range(len(pictures))]
    return Comparison(width, captions, scenario, pictures, 1.0).draw(pictures)


def test_what_is_read_out_is_the_distance_after_settling():
    shown, errors = picture(120, 0.4)
    late = np.arange(121) * 0.02 >= 1.0
    np.testing.assert_allclose(scored_distances(shown), np.linalg.norm(errors[late], axis=1))
    early, errors = picture(20, 0.4)
    np.testing.assert_allclose(scored_distances(early), np.linalg.norm(errors, axis=1))


def test_the_water_drifts_as_fast_as_the_simulations():
    scenario = dataclasses.replace(usm_gym.suite("operation-sea")[0], duration=4.0)
    simulation = Simulation([scenario])
    velocities = []
    for _ in range(round(scenario.duration / scenario.conditions.control_period)):
        simulation.step(np.zeros((1, 5)))
        velocities.append(simulation.read("water_velocity")[0])
    period = scenario.conditions.control_period
    times = period * np.arange(1, len(velocities) + 1)
    told = [velocity(scenario.water, time) for time in times]
    np.testing.assert_allclose(told, velocities, atol=1e-3)
    moved = np.array([drift(scenario.water, time) for time in times])
    speeds = np.gradient(moved, period, axis=0)
    np.testing.assert_allclose(speeds[1:-1], np.array(velocities)[1:-1], atol=1e-3)
    assert np.ptp(velocities, axis=0).min() > 0.01  # it changes


def test_the_water_has_arrows_if_it_moves():
    waters = [Water(), Water(current=(0.03, 0.0)), Water(current=(0.0, 0.03))]
    still, right, up = (
        compared([picture(0, scenario=dataclasses.replace(SCENARIO, water=water))[0]] * 2)
        for water in waters
    )
    for moving in (right, up):  # all else is the same at the start
        assert (still != moving).any(axis=2).sum() > 100
    assert (right != up).any(axis=2).sum() > 100


@pytest.mark.parametrize("count", [2, 3])
def test_every_policy_has_its_own_robot_below_the_last(count):
    frame = compared([picture(60, thrust)[0] for thrust in (0.0, 0.5, -0.5)[:count]])
    heads = np.unique(where(frame, HEAD)[:, 0])
    gaps = np.flatnonzero(np.diff(heads) > 20)
    assert len(gaps) == count - 1
    for colour in COLOURS[:count]:
        assert len(where(frame, colour)) > 50  # its name's tag, its error and its curve
    assert len(where(frame, WATER, 0)) > 10_000


def test_robots_in_space_stand_one_above_the_other():
    shown = [picture(60, thrust, IN_SPACE)[0] for thrust in (0.0, 1.0)]
    frame = compared(shown, scenario=IN_SPACE)
    red, green, blue = np.moveaxis(frame.astype(int), 2, 0)
    heads = np.argwhere(((red - blue > 70) & (green > 0.6 * red))[:340])  # above the chart
    assert len(np.flatnonzero(np.diff(np.unique(heads[:, 0])) > 20)) == 1


@pytest.mark.parametrize("error", [(0.02, 0.0, 0.0), (0.0, 0.02, 0.0), (0.0, 0.0, -0.02)])
def test_a_lens_shows_an_error_as_the_camera_sees_it(error):
    shown, _ = picture(1, scenario=IN_SPACE)
    shown = dataclasses.replace(shown, errors=np.array([error, error]))
    row, frame = SpatialRow(pygame.Rect(0, 0, 452, 122), 1.0, 0.02), pygame.Surface((452, 122))
    row.draw(frame, shown, COLOURS[0])
    pixels = pygame.surfarray.array3d(frame)[344:].swapaxes(0, 1)
    arrow = where(pixels, COLOURS[0], 20).mean(axis=0) - (51, 399 - 344)
    camera = View(following(shown), (0, 0), 1.0, 0.1)
    seen = camera.see(shown.reference + np.array([(0, 0, 0), error]))
    across, down = np.diff(seen, axis=0)[0]
    assert arrow @ (down, across) > 0.9 * np.linalg.norm(arrow) * np.hypot(across, down)


@pytest.mark.parametrize("width", [380, 480, 719])
def test_sizes_suit_an_encoder(width):
    shown, _ = picture(3)
    comparison = Comparison(width, [Caption("a"), Caption("b")], SCENARIO, [shown] * 2, 1.0)
    assert comparison.draw([shown] * 2).shape == (comparison.size[1], width, 3)
    assert comparison.size[1] % 2 == 0


def test_the_same_pictures_give_the_same_frame():
    shown = [picture(40, thrust)[0] for thrust in (0.0, 0.5)]
    first, second = compared(shown), compared(shown)
    assert (first == second).all()
    other = [shown[0], picture(40, -0.5)[0]]
    assert (compared(other) != first).any()


def test_how_the_position_is_measured():
    assert measured(PRESETS["field"]) == "position every 0.02 s"
    assert measured(PRESETS["basin"]) == "position every 0.1 s, 60 ms late"
    assert measured(PRESETS["sea"]) == "position every 1 s, 300 ms late"
