"""Replays of robots whose head follows the path, on the page of `usm report`."""

import dataclasses
import json
import re

import numpy as np
import pytest
from support.browser import complaints, faults, show

from usm_cli.report import chapters, page
from usm_cli.report.blocks import Chapter, Replay
from usm_cli.report.stage import stage_of
from usm_cli.report.tables import conditions_table
from usm_cli.report.words import in_words
from usm_gym.rendering.figure import robot_drawing
from usm_gym.support.provenance import provenance
from usm_gym.task.head_sampling import nominal_head
from usm_gym.task.sampling import named
from usm_gym.task.stored_scenario import as_json, stored
from usm_gym.world import world_of

MODES = ("head", "head3d")


def scenario_of(mode):
    return dataclasses.replace(nominal_head(mode), duration=3.0, settle_time=1.0)


def page_of(blocks, *scenarios):
    robots = chapters.robots({scenario.mode: [scenario] for scenario in scenarios})
    return page.html([Chapter("Episodes", "Two policies.", blocks, robots=robots)], provenance({}))


@pytest.fixture(scope="module", params=MODES)
def scenario(request):
    return scenario_of(request.param)


@pytest.fixture(scope="module")
def block(scenario):
    """A replay of two policies."""
    rows, axes = {"rates-pd": None, "rates-lqg-joints": None}, world_of(scenario.body).axes
    return chapters.replay([scenario], rows, axes, chapters.Choice(), lambda *numbers: None)


@pytest.fixture(scope="module")
def path(block, scenario, tmp_path_factory):
    """The replay on a page."""
    made = tmp_path_factory.mktemp("head") / "page.html"
    made.write_text(page_of([block], scenario))
    return made


def test_a_result_keeps_its_scenarios(scenario):
    assert stored(scenario) is scenario
    assert stored(json.loads(json.dumps(as_json(scenario)))) == scenario


def test_a_page_speaks_of_the_head(scenario, block):
    assert isinstance(block, Replay)
    text = re.sub(r"\s+", " ", page_of([block], scenario))
    assert "Its head should follow a path" in text
    assert "Its centre of mass should follow" not in text
    assert "Error of the head, magnified" in text
    assert ">the head&#39;s goal<" in text
    assert "reference posture" not in text
    assert "the head traces a figure of" in in_words(scenario)
    row = conditions_table({"suite": [scenario]}).rows[0]
    assert row[-1].text == "the policy's"


def test_a_page_of_both_tasks_explains_both():
    text = re.sub(r"\s+", " ", page_of([], named("nominal", "operation"), scenario_of("head")))
    assert "Its centre of mass should follow a path" in text
    assert "Elsewhere the controller moves the joints of the robot, too. Its head" in text


def test_the_drawing_has_no_error_of_the_centre_of_mass():
    scenario = scenario_of("head")
    drawing, words = stage_of(scenario.body).drawing()
    assert drawing == robot_drawing(scenario.body.robot, on_path=False)
    for text in (drawing, words):
        assert "centre of mass" not in text
    assert 'id="error"' in robot_drawing(scenario.body.robot)


@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_page_is_readable(browser, path, scheme):
    show(browser, path, 400, scheme)
    assert faults(browser) == []


@pytest.mark.slow
def test_the_head_is_beside_its_goal_and_the_station_in_the_middle(browser, path, scenario):
    show(browser, path)
    script = (
        "const replay = replays[0], { data, a } = replay;"
        "const { middle, reference, position } = replay.placeAt(a, 2.0);"
        "const posture = rowAt(a.posture, 20, true);"
        "const { centres, poses, mass } = data.view === 'plane'"
        "  ? linkCentres(posture, data.robot.length, position, data.follower)"
        "  : linkPoses(data.robot, posture, position, data.follower);"
        "replay.goTo(2.0);"
        "return [centres ?? poses.map(({ centre }) => centre), mass, middle, reference, position]"
    )
    centres, mass, middle, reference, position = map(np.array, browser.execute_script(script))
    assert not middle.any()
    np.testing.assert_allclose(reference, scenario.reference_positions()[100], atol=1e-4)
    np.testing.assert_allclose(position, reference, atol=0.02)
    np.testing.assert_allclose(mass, 0.0, atol=0.02)
    robot = scenario.body.robot
    half = robot.lengths[-1] / 2 if scenario.mode == "head3d" else robot.half_length
    ahead = position - centres[-1]
    assert np.linalg.norm(ahead) == pytest.approx(half, abs=1e-3)
    assert ahead @ (centres[-1] - centres[-2]) > 0.0
    assert complaints(browser) == []
