"""The study as a page: every tier has its tables and figures, and all policies are in them."""

import re
from dataclasses import replace

import pytest
from support.results import study
from usm_agents.study import page
from usm_agents.study.figures import draw_all

from usm_gym import statistics
from usm_gym.support.text import figures

AGENTS = [
    *("estimator-lqg-joints-basin", "estimator-sta-navigator-basin"),
    "estimator-sta-navigator-sea",
]


@pytest.fixture(scope="module")
def made():
    return study(AGENTS, 2, 6)


def test_every_policy_of_a_tier_is_in_its_tables(made):
    text = page.markdown(made)
    parts = re.split(r"^## (\w+)\n", text, flags=re.MULTILINE)
    sections = dict(zip(parts[1::2], parts[2::2], strict=True))
    assert list(sections) == ["basin", "sea", "Commands"]
    for name, home in made.homes.items():
        for policy in home.rows:
            assert sections[name].count(f"| {policy} ") >= 3  # scores, shifts, elsewhere
    assert "informed-basin (no competitor)" in sections["basin"]
    agent = "estimator-sta-navigator-sea"
    ratio = made.homes["sea"].against[agent]["indi-sea"].ratios["max_error_x"]
    table = sections["sea"].partition(f"#### {agent}")[2]
    assert f"| indi-sea | {figures(ratio.value)} [" in table
    for row in (row for home in made.homes.values() for row in home.trained.values()):
        assert row.command in sections["Commands"]


def test_all_rows_of_a_table_have_its_columns(made):
    for table in re.findall(r"(?:^\|.*\n)+", page.markdown(made), flags=re.MULTILINE):
        assert len({line.count("|") for line in table.splitlines()}) == 1


def test_the_page_shows_the_figures_that_are_drawn(made, tmp_path, monkeypatch):
    monkeypatch.setattr(statistics, "RESAMPLES", 100)
    draw_all(made, tmp_path)
    shown = re.findall(r"\]\((.*\.svg)\)", page.markdown(made))
    assert sorted(shown) == sorted(path.name for path in tmp_path.glob("*.svg"))
    assert "sea-shifts.svg" in shown


def test_a_study_of_an_older_plant_says_so_in_its_head(made):
    said = "of the plant of 0.1.0, whose step has been mended since"
    assert said in page.markdown(made).partition("## basin")[0]
    today = replace(made, provenance=replace(made.provenance, version="0.2.0"))
    assert "mended" not in page.markdown(today)
