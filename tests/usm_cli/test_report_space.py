"""Replays of robots in space on the page of `usm report`."""

import base64
import dataclasses
import io
import re
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.keys import Keys
from support.browser import complaints, drawn, faults, find, show

from usm_cli.report import chapters, page
from usm_cli.report.blocks import Chapter, Facts, Replay
from usm_cli.report.replay import replayed
from usm_cli.report.stage import stage_of
from usm_cli.report.words import in_words
from usm_gym.rendering import look
from usm_gym.rendering.depiction import depiction_of
from usm_gym.rendering.space.camera import View, following
from usm_gym.rendering.space.figure import spatial_robot_drawing
from usm_gym.simulation import Simulation
from usm_gym.spatial_posture import centre_of_mass, link_poses
from usm_gym.spatial_robot import EELY, EELY_NEUTRAL
from usm_gym.support.provenance import provenance
from usm_gym.task.spatial_sampling import nominal_in_space
from usm_gym.task.spatial_scenario import Scan, SpatialPath
from usm_gym.task.spatial_water import SpatialWater
from usm_gym.task.stored_scenario import OtherScenario

ROOT = Path(__file__).parents[2]
SCENARIO = dataclasses.replace(
    nominal_in_space("operation3d"),
    path=SpatialPath(speed=0.2, ramp=0.0),
    scan=Scan(times=(0.8,), pans=(0.8,), tilts=(0.5,), filter_frequency=None),
    water=SpatialWater(current=(0.02, 0.03, -0.01)),
    duration=2.0,
    settle_time=0.5,
)


def page_of(blocks, **lists):
    robots = chapters.robots(lists or {"nominal": [SCENARIO]})
    return page.html([Chapter("Episodes", "Two policies.", blocks, robots=robots)], provenance({}))


def drawings_of(text):
    """The drawings of robots on a page by their captions."""
    found = re.findall(r"<figcaption[^>]*>(.+?)</figcaption>\s*<img src=.+?base64,(.+?)\"", text)
    return {caption: base64.b64decode(data).decode() for caption, data in found}


@pytest.fixture(scope="module")
def block():
    """A replay of two policies."""
    rows = {"sta": None, "pd": None}
    return chapters.replay([SCENARIO], rows, "xyz", chapters.Choice(), lambda *numbers: None)


@pytest.fixture(scope="module")
def path(block, tmp_path_factory):
    """The replay on a page."""
    made = tmp_path_factory.mktemp("space") / "page.html"
    neutral = [dataclasses.replace(SCENARIO, robot="eely-neutral")]
    made.write_text(page_of([block], one=[SCENARIO], other=neutral))
    return made


@pytest.fixture(scope="module")
def simulation():
    """A robot whose thrusters have pushed it about for a second."""
    made = Simulation([SCENARIO])
    for _ in range(50):
        made.step(np.array([[0.5, -0.5, -0.5, 0.9, 0.2, 0.9, 0.7]]))
    return made


def test_only_a_page_with_a_robot_in_space_carries_three_js(block):
    spatial, other = page_of([block]), page_of([Facts("Nothing", {})])
    assert "WebGLRenderer" in spatial
    assert "WebGLRenderer" not in other
    assert len(other) < len(spatial) / 2
    assert not re.search(r"(src|href)=.(?!#|data:)", spatial)
    assert not re.search(r"@import|fetch\(|XMLHttpRequest", spatial)


@pytest.mark.parametrize(("name", "robot"), [("eely", EELY), ("eely-neutral", EELY_NEUTRAL)])
def test_the_drawing_is_of_the_robot_that_swims(name, robot):
    text = page_of([], suite=[dataclasses.replace(SCENARIO, robot=name)])
    assert drawings_of(text) == {name: spatial_robot_drawing(robot)}


def test_the_leaderboard_says_which_robot_swims_where():
    (file,) = ROOT.glob("results/*/space/leaderboard.json")
    choice = chapters.Choice(policies=())
    made = chapters.chapter(chapters.read(file), choice, lambda *numbers: None)
    found = drawings_of(page.html([made, made], provenance({})))
    eely, neutral = found
    assert eely.startswith("eely: operation3d; ")
    assert neutral == "eely-neutral: operation3d-neutral"
    assert [*found.values()] == [*map(spatial_robot_drawing, (EELY, EELY_NEUTRAL))]


def test_a_page_without_known_robots_draws_none():
    assert drawings_of(page_of([], ball=[OtherScenario(world="Elsewhere", fields={})])) == {}


def test_a_posture_is_the_robots(simulation):
    picture = depiction_of(SCENARIO.body).recorder().picture(simulation)
    stage = stage_of(SCENARIO.body)
    for pose, row in (
        (picture.body, stage.postures([picture])[0]),
        (picture.wanted, stage.references([picture])[0]),
    ):
        rotations, _ = link_poses(SCENARIO.body, np.zeros(3), row[:4], row[4:])
        np.testing.assert_allclose(rotations, pose.rotations, atol=1e-9)


def test_attitudes_that_follow_each_other_can_be_mixed(simulation):
    """A quaternion and its negative are the same attitude; half way between them is none."""
    picture = depiction_of(SCENARIO.body).recorder().picture(simulation)
    turned = []
    for yaw in np.linspace(0.0, 4 * np.pi, 30):
        turn = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
        body = picture.body._replace(rotations=turn @ picture.body.rotations)
        turned.append(dataclasses.replace(picture, body=body))
    quaternions = stage_of(SCENARIO.body).postures(turned)[:, :4]
    assert (np.linalg.norm(np.diff(quaternions, axis=0), axis=1) < 0.3).all()


def test_a_scan_in_words():
    said = in_words(SCENARIO)
    assert "the head looks 46° to the left and 29° up at 0.8 s" in said
    back = dataclasses.replace(SCENARIO.scan, times=(0.4, 1.0), pans=(-0.1, 0), tilts=(-0.2, 0))
    said = in_words(dataclasses.replace(SCENARIO, scan=back))
    assert "looks 6° to the right and 11° down at 0.4 s and ahead at 1.0 s" in said


def test_a_world_that_nothing_draws_has_no_replay():
    other = OtherScenario(world="Elsewhere", fields={})
    made = chapters.replay([other], {"pd": None}, "xyz", chapters.Choice(), lambda *numbers: None)
    assert isinstance(made, Facts)


def test_a_lost_robot_is_replayed_to_its_loss(monkeypatch):
    fast = dataclasses.replace(SCENARIO, path=SpatialPath(speed=2.0, ramp=0.0))
    contenders, _ = chapters.able({"zero": None}, chapters.Choice())
    data = replayed(contenders, fast, 1, lambda: None).data
    assert data["episodes"]["zero"]["lost"]
    assert data["episodes"]["zero"]["posture"]["shape"][0] < data["path"]["shape"][0]


def test_the_colours_are_those_of_the_films():
    style = page.ASSETS.joinpath("page/page.css").read_text()
    light = style[: style.index("@media")]
    for name, colour in (("joint", look.BODY_EDGE), ("nose", look.HEAD_EDGE)):
        assert f"--{name}: #{{:02x}}{{:02x}}{{:02x}};".format(*colour) in light


@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [1280, 400])
def test_a_page_is_readable(browser, path, width, scheme):
    show(browser, path, width, scheme)
    assert faults(browser) == []


def camera(browser):
    """Where the camera is and what it looks at, m."""
    script = "const { position, target } = replays[0].view.camera; return [position, target]"
    return np.array(browser.execute_script(script))


@pytest.mark.slow
def test_the_page_sees_what_the_films_see(browser, path, simulation):
    show(browser, path)
    picture = depiction_of(SCENARIO.body).recorder().picture(simulation)
    posture = stage_of(SCENARIO.body).postures([picture])[0]
    mass = centre_of_mass(SCENARIO.body, *picture.body)
    script = (
        "const { data } = replays[0];"
        "const { poses } = linkPoses(data.robot, ...arguments, data.follower);"
        "return poses.map(({ centre }) => centre)"
    )
    centres = browser.execute_script(script, posture.tolist(), mass.tolist())
    np.testing.assert_allclose(centres, picture.body.centres, atol=1e-3)  # lengths are rounded
    # The same camera as that of the films, on as many points as the page has pixels.
    script = (
        "const { camera } = replays[0].view;"
        "camera.aim(arguments[0], 800, 400);"
        "return arguments[1].map((point) => camera.see(point).slice(0, 2))"
    )
    points = picture.reference + np.random.default_rng(0).uniform(-1.0, 1.0, (20, 3))
    seen = browser.execute_script(script, picture.reference.tolist(), points.tolist())
    view = View(following(picture), (400, 200), 800, 0.1)
    np.testing.assert_allclose(seen, view.see(points), atol=1e-6)


@pytest.mark.slow
def test_the_head_is_where_the_camera_sees_it(browser, path):
    show(browser, path)
    browser.execute_script("replays[0].goTo(1.5)")
    script = (
        "const view = replays[0].view, data = view.data.robot;"
        "const { position } = view.replay.placeAt(view.replay.a, 1.5);"
        "const posture = rowAt(view.replay.a.posture, 15, true);"
        "const { poses } = linkPoses(data, posture, position, view.data.follower);"
        "return view.camera.see(poses[8].centre)"
    )
    expected = browser.execute_script(script)[:2]
    data = drawn(browser, ".solid").partition(",")[2]
    frame = 255 * matplotlib.image.imread(io.BytesIO(base64.b64decode(data)))
    red, green, blue, opacity = np.moveaxis(frame, 2, 0)
    rows, columns = np.nonzero((red - blue > 70) & (green > 0.5 * red) & (opacity > 200))
    assert len(rows) > 200
    np.testing.assert_allclose([columns.mean(), rows.mean()], expected, atol=12)


@pytest.mark.slow
def test_keys_and_buttons_move_the_camera(browser, path):
    show(browser, path)
    water, start, scene = find(browser, ".water"), camera(browser), drawn(browser, ".scene")
    for keys, moves_target in (
        ([Keys.ARROW_LEFT], False),
        ([Keys.ARROW_UP], False),
        ([Keys.SHIFT, Keys.ARROW_RIGHT], True),
        (["+"], False),
    ):
        before = camera(browser)
        water.send_keys(*keys)
        after = camera(browser)
        assert (after[1] != before[1]).any() == moves_target
        assert (after[0] != before[0]).any()
        assert drawn(browser, ".scene") != scene
    water.send_keys("0")
    np.testing.assert_allclose(camera(browser), start)
    distances = []
    for name in (".nearer", ".further", ".further"):
        find(browser, name).send_keys(Keys.ENTER)
        distances.append(np.linalg.norm(np.subtract(*camera(browser))))
    assert distances[0] < distances[1] < distances[2]
    find(browser, ".look-again").send_keys(Keys.ENTER)
    np.testing.assert_allclose(camera(browser), start)
    find(browser, ".side-seen").send_keys("above")
    back, _ = np.array(camera(browser)) - camera(browser)[1]
    assert back[2] > 0.99 * np.linalg.norm(back)
    assert complaints(browser) == []


@pytest.mark.slow
def test_mouse_and_fingers_move_the_camera(browser, path):
    show(browser, path)
    water, start = find(browser, ".water"), camera(browser)
    length = np.linalg.norm(np.subtract(*start))
    ActionChains(browser).drag_and_drop_by_offset(water, 60, -20).perform()
    turned = camera(browser)
    np.testing.assert_allclose(turned[1], start[1])
    assert np.linalg.norm(turned[0] - start[0]) > 0.1
    assert np.linalg.norm(np.subtract(*turned)) == pytest.approx(length)
    ActionChains(browser).key_down(Keys.SHIFT).drag_and_drop_by_offset(water, 0, -50).key_up(
        Keys.SHIFT
    ).perform()
    moved = camera(browser)
    np.testing.assert_allclose(moved[0] - moved[1], turned[0] - turned[1])
    assert moved[1, 2] < turned[1, 2]  # what is dragged up is seen from below
    fingers = (
        "const water = document.querySelector('.water');"
        "water.setPointerCapture = () => {};"
        "const touch = (kind, pointerId, clientX) => water.dispatchEvent(new PointerEvent("
        "'pointer' + kind, { pointerId, clientX, clientY: 300, buttons: 1 }));"
        "touch('down', 7, 400); touch('down', 8, 500); touch('move', 8, 600);"
        "touch('up', 7, 400); touch('up', 8, 600);"
    )
    browser.execute_script(fingers)
    assert np.linalg.norm(np.subtract(*camera(browser))) == pytest.approx(length / 2)
    roll = "document.querySelector('.water').dispatchEvent(new WheelEvent('wheel', "
    roll += "{ deltaY: -100, cancelable: true }))"
    near = camera(browser)
    browser.execute_script("document.activeElement.blur()")
    browser.execute_script(roll)
    np.testing.assert_array_equal(camera(browser), near)  # the page scrolls on
    browser.execute_script("document.querySelector('.water').focus({ preventScroll: true })")
    browser.execute_script(roll)
    assert np.linalg.norm(np.subtract(*camera(browser))) < length / 2
    assert complaints(browser) == []


@pytest.mark.slow
def test_without_webgl_the_robot_is_drawn_as_lines(browser, path):
    hide = (
        "const get = HTMLCanvasElement.prototype.getContext;"
        "HTMLCanvasElement.prototype.getContext = function (kind, ...more) {"
        "return kind.startsWith('webgl') ? null : get.call(this, kind, ...more); };"
    )
    made = browser.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument", {"source": hide})
    try:
        show(browser, path)
        assert "no WebGL" in find(browser, ".plain").text
        assert not find(browser, ".solid").is_displayed()
        script = (
            "const { data } = document.querySelector('.scene').getContext('2d')"
            ".getImageData(0, 0, ...['width', 'height'].map((k) => replays[0].view.canvas[k]));"
            "let count = 0;"
            "for (let i = 0; i < data.length; i += 4)"
            "count += data[i] - data[i + 2] > 100 && data[i + 3] === 255; return count"
        )
        assert browser.execute_script(script) > 100  # the head's orange
        assert complaints(browser) == []
    finally:
        browser.execute_cdp_cmd("Page.removeScriptToEvaluateOnNewDocument", made)


@pytest.mark.slow
def test_errors_are_told_in_three_axes(browser, block, path):
    assert isinstance(block, Replay)
    show(browser, path)
    find(browser, ".time").send_keys(Keys.END)
    heads = browser.find_elements("css selector", ".now thead th")
    assert [head.text for head in heads] == ["controller", "x", "y", "z"]
    captions = [each.text for each in browser.find_elements("css selector", ".charts .caption")]
    assert captions[:3] == [f"error in {axis}, mm" for axis in "xyz"]
    shown = [float(find(browser, f".now .a td:nth-child({k})").text) for k in (2, 3, 4)]
    last = browser.execute_script("return [...replays[0].a.error[replays[0].a.error.length - 1]]")
    np.testing.assert_allclose(shown, 1e3 * np.array(last), atol=0.006)
    picker, lens = find(browser, ".pick-a"), drawn(browser, ".lens")
    other = "pd" if picker.get_attribute("value") == "sta" else "sta"
    picker.send_keys(other)
    assert find(browser, ".now .a th").text == other
    assert drawn(browser, ".lens") != lens
