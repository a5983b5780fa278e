"""Pictures: what they say of the simulation, what is drawn of them, and what is left behind."""

import copy
import dataclasses
import gc
import os
import pickle
import sys

import gymnasium as gym
import numpy as np
import pygame
import pytest
import usm_baselines

import usm_gym
from usm_gym.rendering.canvas import SCENE, Canvas
from usm_gym.rendering.chart import error_scale
from usm_gym.rendering.depiction import depiction_of
from usm_gym.rendering.look import HEAD, JET_CORE, REFERENCE, TAIL, TRAIL
from usm_gym.rendering.picture import Recorder
from usm_gym.rendering.scene import OUTLINE
from usm_gym.rendering.window import Window, _windows

ID = "usm_gym:USM-Operation-v0"
RESIDUAL = "usm_agents:USM-OperationResidual-v0"
SPATIAL = "usm_gym:USM-Operation3D-v0"
HEAD_IDS = ("usm_gym:USM-Head-v0", "usm_gym:USM-Head3D-v0")


def vector(count, id=ID, **arguments):
    return gym.make_vec(id, num_envs=count, vectorization_mode="vector_entry_point", **arguments)


def episode(steps, policy="sta", render_mode="rgb_array", scenario="nominal", **arguments):
    """An environment some steps into an episode, and the true positions on the way."""
    env = gym.make(ID, render_mode=render_mode, **arguments)
    observation, _ = env.reset(options={"scenario": scenario})
    controller, state = usm_baselines.make(policy, env), None
    positions = [env.unwrapped.simulation.read("position")[0]]
    for _ in range(steps):
        action, state = controller.predict(observation, state)
        observation, *_ = env.step(action)
        positions.append(env.unwrapped.simulation.read("position")[0])
    return env, np.array(positions)


def places(frame, colour, tolerance=6):
    """Where in the scene a frame has a colour, (k, 2): columns and rows."""
    scene = frame[SCENE.top : SCENE.bottom].astype(int)
    rows, columns = np.nonzero(np.abs(scene - colour).max(axis=2) <= tolerance)
    return np.stack([columns, rows], axis=1)


def test_a_picture_is_the_simulations():
    env, positions = episode(560)
    simulation = env.unwrapped.simulation
    (recorder,) = env.unwrapped._viewer._recorders
    picture = recorder.picture(simulation)
    theta = simulation.read("theta")[0]
    assert picture.time == pytest.approx(11.2)
    np.testing.assert_allclose(picture.body.centres.mean(axis=0), positions[-1], atol=1e-12)
    ends = 0.07 * np.stack([np.cos(theta), np.sin(theta)], axis=1)
    tips, heels = picture.body.centres + ends, picture.body.centres - ends
    np.testing.assert_allclose(tips[:-1], heels[1:], atol=1e-12)  # the links hang together
    np.testing.assert_array_equal(picture.instants, np.arange(561))
    np.testing.assert_allclose(picture.path[:561] + picture.errors, positions, atol=1e-12)
    assert picture.max_error.tolist() == simulation.max_error[0].tolist()
    # The joints bend from 10 s on; the reference posture is where they shall be.
    reference = picture.reference
    layout = env.unwrapped.layout
    wanted = (simulation.observation[0] * layout.scale)[layout.slices["joint_references"]]
    np.testing.assert_allclose(reference.angles[:-1] - reference.angles[1:], wanted, atol=1e-9)
    assert reference.angles.mean() == pytest.approx(0.0, abs=1e-9)
    np.testing.assert_allclose(reference.centres.mean(axis=0), picture.path[560], atol=1e-12)


def test_jets_lag_behind_the_commands_and_blow_against_the_force():
    env = gym.make(ID, render_mode="rgb_array")
    env.reset(options={"scenario": "nominal"})
    assert len(places(env.render(), JET_CORE)) == 0
    env.step(np.array([0, 1, 0, 0, 0], np.float32))  # to the left: upwards
    simulation = env.unwrapped.simulation
    thrust = Recorder().picture(simulation).thrust
    assert thrust == pytest.approx([0, 1 - np.exp(-0.02 / 0.05), 0, 0, 0], abs=1e-9)
    frame = env.render()
    jet = places(frame, JET_CORE)
    assert len(jet) > 0
    assert jet[:, 1].min() > places(frame, HEAD)[:, 1].max() - 6  # below the straight body
    for _ in range(10):
        env.step(np.array([0, 1, 0, 0, 0], np.float32))
    assert len(places(env.render(), JET_CORE)) > 2 * len(jet)


def test_the_frame_shows_the_robot():
    env, _ = episode(620)
    frame = env.render()
    assert frame.shape == (480, 640, 3)
    assert frame.dtype == np.uint8
    head, tail = places(frame, HEAD), places(frame, TAIL)
    assert len(head) > 100
    assert len(tail) > 100
    assert head[:, 0].mean() - tail[:, 0].mean() > 300
    assert len(places(frame, TRAIL)) > 10
    assert len(places(frame, OUTLINE)) > 10  # the body lags behind the reference
    cross = places(frame, REFERENCE)
    middle = np.array([SCENE.centerx, SCENE.centery - SCENE.top])
    assert np.abs(cross - middle).max() < 20  # the goal, which the view follows
    assert np.ptp(cross, axis=0).min() > 20
    env.step(np.zeros(5, np.float32))
    assert (env.render() != frame).any()


@pytest.mark.parametrize("width", [320, 640, 960])
def test_frames_have_any_width(width):
    env, _ = episode(3)
    canvas = Canvas(width)
    frame = canvas.draw(Recorder().picture(env.unwrapped.simulation), "sta")
    assert frame.shape == (width * 3 // 4, width, 3)


def test_the_scale_of_the_error_is_round_and_large_enough():
    for largest, scale in ((0.0, 1e-4), (0.0019, 2e-3), (0.002, 5e-3), (0.3, 0.5), (40.0, 5.0)):
        assert error_scale(np.array([[0.0, -largest]])) == pytest.approx(scale)


@pytest.mark.parametrize("id", [ID, SPATIAL, *HEAD_IDS])
def test_rendering_does_not_touch_the_physics(id):
    plain, rendered = gym.make(id), gym.make(id, render_mode="rgb_array")
    for env in (plain, rendered):
        env.reset(seed=3)
    size = plain.action_space.shape
    for action in np.random.default_rng(0).uniform(-1, 1, (5, *size)).astype(np.float32):
        before, *_ = plain.step(action)
        after, *_ = rendered.step(action)
        rendered.render()
        assert (before == after).all()


@pytest.mark.parametrize("id", [ID, SPATIAL, *HEAD_IDS])
def test_a_robot_that_is_lost_is_drawn(id):
    # Not finite; half a metre away.
    for conditions in ({"integrator": "explicit", "physics_step": 0.02}, "field"):
        env = gym.make(id, render_mode="rgb_array", conditions=conditions)
        env.reset(seed=0)
        terminated = False
        while not terminated:
            *_, terminated, _, _ = env.step(np.ones(env.action_space.shape, np.float32))
        simulation = env.unwrapped.simulation
        picture = depiction_of(simulation.scenarios[0].body).recorder().picture(simulation)
        assert picture.lost
        assert all(np.isfinite(each).all() for each in (picture.body.centres, picture.errors))
        assert env.render().shape == (480, 640, 3)


def test_a_restored_episode_has_no_trail_that_it_was_not_seen_to_leave():
    env, _ = episode(40)
    snapshot = env.unwrapped.snapshot()
    other, _ = episode(2)
    other.unwrapped.restore(snapshot)
    picture = other.unwrapped._viewer._recorders[0].picture(other.unwrapped.simulation)
    assert picture.instants.tolist() == [40]
    assert other.render().shape == (480, 640, 3)


@pytest.mark.parametrize("id", [ID, RESIDUAL, SPATIAL])
def test_a_vector_environment_gives_an_image_of_each_robot(id):
    envs = vector(3, id, render_mode="rgb_array")
    singles = [gym.make(id, render_mode="rgb_array") for _ in range(3)]
    envs.reset(seed=5)
    for seed, env in enumerate(singles, 5):
        env.reset(seed=seed)
    size = envs.single_action_space.shape
    for actions in np.random.default_rng(1).uniform(-1, 1, (30, 3, *size)).astype(np.float32):
        envs.step(actions)
        for env, action in zip(singles, actions, strict=True):
            env.step(action)
    for _ in range(2):
        frames = envs.render()
        assert len(frames) == 3
        for frame, env in zip(frames, singles, strict=True):
            assert (frame == env.render()).all()
    envs.close()


@pytest.mark.parametrize("id", [ID, SPATIAL])
def test_a_window_shows_the_chosen_robot_of_a_vector(id, monkeypatch):
    shown = []
    monkeypatch.setattr(Window, "show", lambda window, frame, fps: shown.append(frame))
    envs = vector(3, id, render_mode="human", render_index=2)
    single = gym.make(id, render_mode="rgb_array")
    envs.reset(seed=5)
    single.reset(seed=7)
    assert envs.render() is None
    assert len(shown) == 2
    assert (shown[-1] == single.render()).all()
    envs.close()
    with pytest.raises(ValueError, match="render_index is 3; allowed: 0 to 2"):
        vector(3, id, render_index=3)


def test_an_episode_after_another_starts_a_trail_of_its_own():
    scenario = dataclasses.replace(usm_gym.suite("operation")[0], duration=0.2, settle_time=0.1)
    envs = vector(1, render_mode="rgb_array")
    envs.reset(options={"scenario": scenario})
    for _ in range(13):  # ten steps, the reset, two steps
        envs.step(np.zeros((1, 5), np.float32))
    picture = envs._viewer._recorders[0].picture(envs.simulation)
    assert picture.instants.tolist() == [0, 1, 2]


@pytest.mark.parametrize("id", [ID, SPATIAL])
def test_the_frame_rate_is_the_control_rate(id):
    assert gym.make(id).metadata["render_fps"] == 50
    slow = gym.make(id, conditions={"control_period": 0.04})
    assert slow.unwrapped.metadata["render_fps"] == 25


def test_a_window_that_is_closed_by_hand_ends_nothing():
    others = set(_windows)
    env, _ = episode(2, render_mode="human")
    assert env.render() is None
    (window,) = _windows - others
    pygame.event.post(pygame.Event(pygame.WINDOWCLOSE, window=window))
    env.step(np.zeros(5, np.float32))
    assert _windows == others
    env.step(np.zeros(5, np.float32))
    env.close()


@pytest.mark.skipif(not os.path.exists("/proc/self/fd"), reason="no /proc")
@pytest.mark.parametrize("render_mode", ["human", "rgb_array"])
@pytest.mark.parametrize("id", [ID, SPATIAL])
def test_environments_leave_nothing_behind(id, render_mode):
    def left():
        gc.collect()
        files, threads = os.listdir("/proc/self/fd"), os.listdir("/proc/self/task")
        return len(files), len(threads), set(_windows)

    def use():
        env = gym.make(id, render_mode=render_mode)
        env.reset(options={"scenario": "nominal"})
        env.render()
        env.close()
        env.close()

    use()  # loads libraries once
    before = left()
    for _ in range(5):
        use()
    assert left() == before


def test_without_pygame_all_but_drawing_works(monkeypatch):
    monkeypatch.setitem(sys.modules, "pygame", None)
    monkeypatch.delitem(sys.modules, "usm_gym.rendering.canvas")
    env = gym.make(ID, render_mode="rgb_array")
    env.reset(seed=0)
    env.step(np.zeros(5, np.float32))
    with pytest.raises(gym.error.DependencyNotInstalled) as caught:
        env.render()
    assert str(caught.value) == (
        "render_mode='rgb_array' needs pygame: pip install 'usm-gym[render]'"
    )
    with pytest.raises(gym.error.DependencyNotInstalled, match="render_mode='human' needs pygame"):
        gym.make(ID, render_mode="human").reset(seed=0)


@pytest.mark.parametrize("quit", [pygame.quit, pygame.font.quit])
def test_rendering_outlives_anybodys_quit(quit):
    env, _ = episode(3)
    canvas, picture = Canvas(), Recorder().picture(env.unwrapped.simulation)
    canvas.draw(picture, "before")
    quit()
    frame = canvas.draw(picture, f"a title not drawn before {quit}")
    assert (frame[:30, :300] != 255).any()
    assert env.render().shape == (480, 640, 3)


def test_a_window_outlives_anybodys_quit():
    others = set(_windows)
    env, _ = episode(2, render_mode="human")
    for again in (lambda: None, pygame.display.init):
        (old,) = _windows - others
        pygame.quit()
        again()
        env.step(np.zeros(5, np.float32))
        (window,) = _windows - others
        assert window is not old
        assert window.title == "usm-gym"
    env.close()
    assert _windows == others


@pytest.mark.parametrize("render_mode", [None, "human", "rgb_array"])
@pytest.mark.parametrize("copied", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])
@pytest.mark.parametrize(
    "make",
    [
        lambda **mode: gym.make(ID, **mode),
        lambda **mode: gym.make(RESIDUAL, **mode),
        lambda **mode: gym.make(SPATIAL, **mode),
        lambda **mode: vector(3, **mode),
        lambda **mode: vector(3, RESIDUAL, **mode),
    ],
    ids=["single", "residual", "spatial", "vector", "residual vector"],
)
def test_a_copy_goes_on_as_the_original(make, copied, render_mode):
    env = make(render_mode=render_mode)
    env.reset(seed=0)
    env.action_space.seed(0)
    env.step(env.action_space.sample())
    env.render()
    other = copied(env)
    for _ in range(3):
        action = env.action_space.sample()
        for ours, theirs in zip(env.step(action), other.step(action), strict=True):
            np.testing.assert_equal(ours, theirs)
    np.testing.assert_equal(env.render(), other.render())
    first, second = (each.unwrapped.simulation for each in (env, other))
    np.testing.assert_equal(first.read("position"), second.read("position"))
    np.testing.assert_equal(first.snapshot().arrays, second.snapshot().arrays)
    env.close()
    other.close()
