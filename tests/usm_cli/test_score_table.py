"""The table of `usm evaluate` on terminals of any width, and the sentence below it."""

import re
from dataclasses import replace

import numpy as np
import pytest
from rich.console import Console
from support.episodes import METRICS
from usm_baselines.benchmark.leaderboard import ranked, ranks
from usm_baselines.contender import contender

from usm_cli.score_table import combined_error, conclusion, legend, shift_table, table
from usm_gym import statistics
from usm_gym.evaluation import SHIFT_METRICS, Evaluation

NAMES = ("adaptive", "lqg-joints-tuned", "sta-shtessel-lag-tuned", "pd-navigator-basin")
LONG = "my_very_own_package.controllers.sliding_mode:SuperTwistingWithAVeryLongName"


@pytest.fixture(autouse=True)
def _quick(monkeypatch):
    monkeypatch.setattr(statistics, "RESAMPLES", 1000)


def evaluation(error, noise=0.0, episodes=50, lost=0, metrics=METRICS):
    """Return scores with these errors, m, in all metrics."""
    rng = np.random.default_rng(0)
    values = error * (1 + noise * rng.standard_normal(episodes))
    return Evaluation(dict.fromkeys(metrics, values), np.arange(episodes) < lost)


def pairs(*errors, names=NAMES, **options):
    """Return policies with these errors, the smaller the better."""
    return [
        (replace(contender("pd"), name=name), evaluation(error, **options))
        for name, error in zip(names, errors, strict=False)
    ]


def printed(made, width, **options):
    """Return what a console of this width shows of something."""
    console = Console(width=width, highlight=False, **options)
    with console.capture() as capture:
        console.print(made(console))
    return capture.get()


def concluded(scores):
    """Return the sentence below a table."""
    return conclusion(ranked(scores))


@pytest.mark.parametrize("lost", [0, 3])
@pytest.mark.parametrize("width", [80, 100, 120, 140, 200])
def test_every_width_shows_whole_names_in_order_and_what_there_is_room_for(width, lost):
    rows = ranked(pairs(4e-3, 3e-3, 2e-3, 1e-3, noise=0.1, lost=lost))
    shown = printed(lambda console: table(rows, console), width)
    assert "…" not in shown
    assert max(map(len, shown.splitlines())) <= width
    places = [shown.index(name) for name in reversed(NAMES)]
    assert places == sorted(places)
    assert all(heading in shown for heading in ("policy", "error x + y", "N/s", "lost"))
    assert shown.count("±") == len(NAMES)
    if width == 200:
        assert "told" in shown
        assert "rms" in shown


def test_a_wider_table_shows_no_less():
    rows = ranked(pairs(1e-3, 2e-3, noise=0.1))
    counts = [
        len(table(rows, Console(width=width)).columns) for width in (40, 80, 100, 120, 140, 180)
    ]
    assert counts == sorted(counts)
    assert counts[0] < counts[-1]
    assert len(table(rows, Console(width=20)).columns) == 5


def test_a_name_longer_than_the_terminal_goes_on_below():
    rows = ranked(pairs(1e-3, names=[LONG]))
    shown = printed(lambda console: table(rows, console), 60)
    parts = [re.sub("^ *1? +", "", line).split(" ")[0] for line in shown.splitlines()[4:]]
    assert "".join(parts) == LONG


def test_the_best_stands_out_and_losses_are_tinted():
    rows = ranked(pairs(1e-3, 2e-3, noise=0.1) + pairs(3e-3, names=["lossy"], lost=2))
    shown = printed(lambda console: table(rows, console), 80, force_terminal=True).splitlines()
    best, second, lossy = (
        next(line for line in shown if name in line) for name in (*NAMES[:2], "lossy")
    )
    assert "\x1b[1m" in best
    assert "\x1b[" not in second
    assert re.search(r"\x1b\[31m[^m]*2 \(4 %\)", lossy)


def test_no_row_stands_out_where_the_data_tell_none_apart():
    rows = ranked(pairs(1e-3, 2e-3, episodes=4))
    assert set(ranks(rows).values()) == {1}
    shown = printed(lambda console: table(rows, console), 80, force_terminal=True)
    assert all("\x1b[" not in line for line in shown.splitlines() if NAMES[0] in line)


def test_the_error_is_the_sum_over_the_axes_with_its_interval():
    rng = np.random.default_rng(1)
    x, y = rng.normal(2e-3, 5e-4, (2, 50))
    scores = evaluation(1e-3)
    scores.per_episode.update(max_error_x=x, max_error_y=y)
    (row,) = ranked([(contender("pd"), scores)]).values()
    mean, margin = map(float, combined_error(row).split(" ± "))
    total = 1e3 * (x + y)
    assert mean == pytest.approx(total.mean(), rel=5e-3)
    # The interval of the mean is close to the normal one.
    assert margin == pytest.approx(1.96 * total.std() / 50**0.5, rel=0.1)


def test_the_sentence_names_the_winner_and_by_how_much():
    said = concluded(pairs(2e-3, 1e-3, 4e-3, noise=0.1))
    # With the same noise, every episode of the second is twice as bad as that of the first.
    assert said.startswith(f"{NAMES[1]} wins with an error of ")
    assert f"the objective of {NAMES[0]}, the next, is 2.00 times as large" in said
    assert "(95 % interval 2.00 to 2.00), over 50 scenarios." in said


def test_the_sentence_says_whom_the_data_do_not_tell_from_the_first():
    first, second, third, other = pairs(1e-3, 1e-3, 2e-3, 1e-3, noise=0.1)
    turned = {name: values[::-1].copy() for name, values in second[1].per_episode.items()}
    tied = [first, (second[0], replace(second[1], per_episode=turned))]
    ahead, behind = NAMES[:2]
    said = concluded([*tied, third])
    assert said.startswith(f"{ahead} is ahead with an error of ")
    assert f"the data do not tell it from {behind}; the objective of {NAMES[2]}" in said
    assert "is 2.00 times as large" in said
    said = concluded([*tied, other])
    assert said == (
        f"{ahead} is ahead over 50 scenarios, but the data do not tell it from "
        f"{behind} and {NAMES[3]}."
    )


def test_from_few_scenarios_nothing_is_concluded():
    said = concluded(pairs(1e-3, 9e-3, episodes=4))
    assert "4 scenarios cannot say who wins" in said
    assert f"{NAMES[0]} wins" not in said


def test_what_is_told_more_than_a_vehicle_knows_does_not_win():
    seer = replace(contender("zero"), name="seer", privileged=True), evaluation(1e-6)
    scores = [seer, *pairs(1e-3, 2e-3, noise=0.1)]
    assert concluded(scores).startswith(f"{NAMES[0]} wins")
    assert "no competitors" in legend(ranked(scores))
    assert "no competitors" not in legend(ranked(scores[1:]))
    alone = concluded(scores[:2])
    assert alone.startswith(f"{NAMES[0]} has an error of ")
    assert alone.endswith(" over 50 scenarios; name a second policy to compare it with.")
    assert concluded(scores[:1]) == "None of these policies competes."


def test_a_narrow_table_of_shifts_keeps_the_first_and_the_last():
    metrics = [*METRICS, *(f"{name}_{axis}" for name in SHIFT_METRICS for axis in "xy")]
    rows = ranked(pairs(1e-3, 2e-3, metrics=metrics))
    for width, shifts in ((60, {"first", "last"}), (120, {"first", "third", "fifth", "last"})):
        shown = printed(lambda console: shift_table(rows, console), width)
        assert {each for each in ("first", "third", "fifth", "last") if each in shown} == shifts
        assert all(name in shown for name in NAMES[:2])
