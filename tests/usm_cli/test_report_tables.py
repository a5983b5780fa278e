"""The tables of a report: ranks, rivals, scales, tabs, and the sentences above them."""

import dataclasses
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from support.axe import violations
from support.browser import find, show
from support.results import scores

from usm_cli.report import chapters, page, tables, words
from usm_gym.statistics import compare
from usm_gym.support.provenance import provenance

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def board(tmp_path_factory):
    """The stored leaderboard, and its page without a replay."""
    (file,) = ROOT.glob("results/*/leaderboard.json")
    result = chapters.read(file)
    made = chapters.chapter(result, chapters.Choice(policies=()), lambda *numbers: None)
    path = tmp_path_factory.mktemp("board") / "page.html"
    path.write_text(page.html([made], provenance({})))
    return result, path


def made_up(count, episodes=50):
    """Rows of policies with random errors, best first."""
    rng = np.random.default_rng(0)
    rows = {}
    for k in range(count):
        row = scores("xy", 1e-3 * (1 + 0.1 * k), episodes)
        drawn = {f"max_error_{axis}": tuple(rng.lognormal(0.1 * k, 0.3, episodes)) for axis in "xy"}
        rows[f"policy{k}"] = dataclasses.replace(row, per_episode={**row.per_episode, **drawn})
    return rows


@pytest.mark.parametrize("episodes", [49, 50])
def test_rivals_are_what_comparisons_say(episodes):
    rows = made_up(4, episodes)
    found = tables.rivals(rows)
    for k, one in enumerate(rows.values()):
        for j, other in enumerate(rows.values()):
            expected = compare(other.objectives, one.objectives)
            letter = "y" if expected.difference < 0 else "n"
            few = "f" if episodes < 50 else "u"
            assert found.verdicts[k][j] == (letter if expected.decided else few)
            assert found.chances[k][j] == round(100 * expected.improvement)


def test_bars_stay_on_their_scale():
    rows = {"best": scores("x", 1e-3, 5), "far": scores("x", 1.0, 5)}
    scale = tables.LogScale(rows.values())
    near, far = (scale.marks(row.errors)["x"] for row in rows.values())
    assert near.beyond == ""
    assert 0 < near.low < near.mean < near.high < near.worst < 100
    assert (far.beyond, far.mean) == ("›", 100)
    places = [place for _, place in scale.ticks]
    assert min(np.diff(places)) > 15


def test_most_of_the_error_comes_after_a_bend_only_where_it_does():
    row = scores("xy", 1e-3, 5)  # the settled errors are half of the largest ones
    said = words.motion({"sta": row})
    assert "3.00 mm then, 1.50 mm otherwise (x + y, median of 1 controller)" in said
    larger = {**row.metrics, "settled_error_y": row.metrics["max_error_y"]}
    assert words.motion({"sta": dataclasses.replace(row, metrics=larger)}) == ""


def test_the_glossary_explains_what_is_there():
    assert list(words.glossary(["lqg", "mine:Law", "sta-lag-tuned"])) == [
        "sta",
        "lqg",
        "…-lag",
        "…-tuned",
    ]


@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_leaderboard_fits_a_screen_and_hints_at_more_on_a_phone(browser, board, scheme):
    hidden = "return [...document.querySelectorAll('.hint')].map((hint) => hint.hidden)"
    for width, fits in ((1280, True), (400, False)):
        show(browser, board[1], width, scheme)
        assert violations(browser) == []
        tabs = browser.find_elements("css selector", "[role=tab]")
        assert len(tabs) == 3 + len(board[0].suites)
        for tab in tabs:
            browser.execute_script("arguments[0].click()", tab)
            panel = f"#{tab.get_attribute('aria-controls')}"
            assert find(browser, panel).is_displayed()
            wide = browser.execute_script(
                "const box = document.querySelector(arguments[0] + ' .scroll');"
                "return box.scrollWidth > box.clientWidth",
                panel,
            )
            assert not (fits and wide), tab.text
            assert find(browser, f"{panel} .hint").is_displayed() == wide
        assert all(browser.execute_script(hidden)) == fits


@pytest.mark.slow
def test_a_rival_can_be_chosen_and_the_next_is_next_only_in_order(browser, board):
    show(browser, board[1])
    rows = list(board[0].main.values())
    table = ".choice[data-choice=operation]"
    cells = "return [...document.querySelectorAll(arguments[0] + ' tbody .beats')]"
    cells += ".map((cell) => cell.textContent)"

    def expected(one, other):
        found = compare(other.objectives, one.objectives)
        word = ("yes" if found.difference < 0 else "no") if found.decided else "undecided"
        return f"{word}, {round(100 * found.improvement)} %"

    told = browser.execute_script(cells, table)
    assert told[:3] == [expected(*pair) for pair in pairwise(rows[:4])]
    find(browser, f"{table} th:nth-child(2) button").send_keys("\ue007")
    find(browser, f"{table} th:nth-child(2) button").send_keys("\ue007")
    assert not find(browser, f"{table} td.beats").is_displayed()
    find(browser, f"{table} th:nth-child(1) button").send_keys("\ue007")
    assert find(browser, f"{table} td.beats").is_displayed()
    rival = list(board[0].main)[5]
    browser.execute_script(
        "const pick = document.querySelector(arguments[0] + ' [data-rivals]');"
        "pick.value = arguments[1]; pick.dispatchEvent(new Event('change'))",
        table,
        rival,
    )
    told = browser.execute_script(cells, table)
    assert told[:2] == [expected(row, rows[5]) for row in rows[:2]]
    assert told[5] == ""
    find(browser, f"{table} th:nth-child(2) button").send_keys("\ue007")
    assert find(browser, f"{table} td.beats").is_displayed()
