"""Draws the pictures of the pages anew: `python docs/draw.py`."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import usm_baselines
from usm_baselines.benchmark.leaderboard import LeaderboardResult

import usm_gym
from usm_gym.evaluation import rollout
from usm_gym.rendering.figure import robot_drawing
from usm_gym.rendering.space.figure import spatial_robot_drawing
from usm_gym.rendering.svg import arrow, box, document, group, line, text
from usm_gym.robot import Robot
from usm_gym.spatial_robot import EELY
from usm_gym.task.conditions import FIELD

SIZE = 640, 418
BLOCK = np.array([160.0, 84.0])
# Left sides of the columns, tops of the rows.
COLUMNS, ROWS = (32.0, 240.0, 448.0), (112.0, 302.0)
# Row, column, colour, name, what it does.
BLOCKS = (
    (0, 0, "thrust", "Thrusters", "lag, dead-band,", "gain, limit"),
    (0, 1, "edge", "Plant", "links, joints, drag,", "added mass"),
    (0, 2, "edge", "Sensors", "noisy, late, rare,", "sometimes missing"),
    (1, 2, "head-edge", "Navigator", "estimates error,", "rate, disturbance"),
    (1, 1, "head-edge", "Law", "asks for a force", "and a moment"),
    (1, 0, "head-edge", "Allocation", "shares them out", "among thrusters"),
)


def control_loop() -> str:
    """Draw what stands between a scenario and the thrusters, and what passes between them."""
    step, period = 1e3 * FIELD.physics_step, 1e3 * FIELD.control_period
    description = (
        "A scenario sets up thrusters, plant and sensors, which are the environment. The "
        "observation leads from the sensors to the policy: navigator, law and allocation. Its "
        "action leads back to the thrusters. Reward and score come from the plant."
    )
    marks = [
        *_frame(16, 196, f"environment: steps of {step:g} ms"),
        *_frame(262, 140, f"policy: every {period:g} ms"),
        _scenario(),
        *(_block(*block) for block in BLOCKS),
        *_signals(),
    ]
    return document(SIZE, "From a scenario to the thrusters and back", description, marks)


def _frame(top: float, height: float, name: str) -> list[str]:
    middle = SIZE[0] / 2
    return [
        box("panel", (16, top), (SIZE[0] - 32, height), "rule", "5 4"),
        text(name, (middle, top), (0, 22), "small", "quiet", "middle"),
    ]


def _scenario() -> str:
    left, right = COLUMNS[0], COLUMNS[-1] + BLOCK[0]
    top, height = 48.0, 36.0
    contents = "path, joint motion, water, conditions, seed"
    marks = [
        box("card", (left, top), (right - left, height), "edge"),
        text("Scenario", (left, top), (14, 24), "title", halo=""),
        text(contents, (right, top), (-14, 24), "small", anchor="end", halo=""),
    ]
    for x in np.add(COLUMNS, BLOCK[0] / 2):
        marks.append(arrow("quiet", (x, top + height), (x, ROWS[0]), 2))
    return group("scenario", *marks)


def _block(row: int, column: int, colour: str, name: str, *words: str) -> str:
    corner = np.array([COLUMNS[column], ROWS[row]])
    x = BLOCK[0] / 2
    marks = [text(name, corner, (x, 26), "title", anchor="middle", halo="")]
    for k, said in enumerate(words):
        marks.append(text(said, corner, (x, 49 + 20 * k), "small", anchor="middle", halo=""))
    return group(name.lower(), box("card", corner, BLOCK, colour), *marks)


def _signals() -> list[str]:
    (first, second, third), (above, below), (width, height) = COLUMNS, ROWS, BLOCK
    marks = []
    for start, end, row, words, colour in (
        (first + width, second, above, "*f*_j", "thrust"),
        (second + width, third, above, "*p*, *θ*_i", "ink"),
        (third, second + width, below, "*ê*", "error"),
        (second, first + width, below, "*F*, *M*", "ink"),
    ):
        y = row + height / 2
        marks.append(arrow(colour, (start, y), (end, y), 2.6))
        marks.append(text(words, ((start + end) / 2, y), (0, -10), name=colour, anchor="middle"))
    left, middle, right = np.add(COLUMNS, width / 2)
    bottom = above + height
    return [
        *marks,
        arrow("ink", (right, bottom), (right, below), 2.6),
        text("observation", (right, 242), (-12, 0), anchor="end"),
        arrow("thrust", (left, below), (left, bottom), 2.6),
        text("action", (left, 242), (12, 0), name="thrust"),
        arrow("error", (middle, bottom), (middle, 228), 2.6),
        text("reward, score", (middle, 248), name="error", anchor="middle"),
    ]


# The panels of `joint_motion`: left and right side, their tops, height, and points of a line.
SIDES, TOPS, HEIGHT, POINTS = (66.0, 616.0), (54.0, 196.0), 116.0, 250


def joint_motion() -> str:
    """Draw what the joints do to the centre of mass: an episode with them still and moving."""
    moving = usm_gym.suite("operation")[0]
    still = replace(moving, conditions=replace(moving.conditions, motion=False))
    policy = usm_baselines.make("lqg-tuned", moving.nominal)
    runs = dict(zip(("error", "quiet"), rollout(policy, [moving, still]), strict=True))
    reach = np.ceil(max(1e3 * np.abs(run.error).max() for run in runs.values()))
    marks = [_frames(moving, reach)]
    for name, run in runs.items():
        for k, top in enumerate(TOPS):
            heights = top + HEIGHT / 2 * (1 - 1e3 * run.error[:, k] / reach)
            places = np.interp(run.time, (0.0, moving.duration), SIDES)
            marks.append(line(name, _extremes(places, heights), 1.4))
    description = (
        "The same episode twice, with the controller lqg-tuned. Joints that stay still leave an "
        "error of the centre of mass near zero; joints that move push it off at every motion."
    )
    return document((640, 356), "What moving joints do to the centre of mass", description, marks)


def _frames(scenario: usm_gym.Scenario, reach: float) -> str:
    """Axes, the times when the joints start to move, and what the lines are."""
    (left, right), bottom = SIDES, TOPS[-1] + HEIGHT
    marks = [
        text("joints move", (left, 34), name="error"),
        text("joints stay still", (left, 34), (110, 0), name="quiet"),
        text("dotted: joints start to move", (right, 34), (0, 0), "small", "ink", "end"),
    ]
    for top, axis in zip(TOPS, "xy", strict=True):
        marks.append(text(f"error in *{axis}*, mm", (left, top), (6, 16), "small", "quiet"))
        for share, value in ((0.0, reach), (0.5, 0.0), (1.0, -reach)):
            height = top + share * HEIGHT
            marks.append(line("rule", [(left, height), (right, height)], 1.0))
            words = f"{value:g}".replace("-", "−")
            marks.append(text(words, (left, height), (-8, 5), "small", "quiet", "end"))
        for shift in scenario.shifts:
            x = np.interp(shift, (0.0, scenario.duration), SIDES)
            marks.append(line("ink", [(x, top), (x, top + HEIGHT)], 1.0, "2 4"))
    for time in range(0, round(scenario.duration) + 1, 10):
        x = np.interp(time, (0.0, scenario.duration), SIDES)
        marks.append(text(f"{time} s", (x, bottom), (0, 24), "small", "quiet", "middle"))
    return group("frames", *marks)


def _extremes(x: np.ndarray, y: np.ndarray) -> Sequence[tuple[float, float]]:
    """A line through the smallest and the largest height in every part of its way."""
    kept: list[int] = []
    for part in np.array_split(np.arange(len(y)), POINTS):
        kept += sorted({int(part[y[part].argmin()]), int(part[y[part].argmax()])})
    return [(x[k], y[k]) for k in kept]


# Who holds the body while the same law moves the head, and in which colour they are drawn.
HOLDERS = {"sta": "error", "lqg-joints": "quiet", "oracle": "head-edge"}
# Boards of the head, and where their bars begin; the longest bar.
PANELS, LONGEST = {"head": ("in the plane", 56.0), "head3d": ("in space", 196.0)}, 350.0


def held_by() -> str:
    """Draw the error of the head by who holds the body, from the published leaderboards."""
    marks = []
    for board, (title, top) in PANELS.items():
        path = Path(__file__).parents[1] / "results" / usm_gym.__version__ / board
        rows = LeaderboardResult.read(path / "leaderboard.json").main
        errors = {name: 1e3 * rows[f"rates-{name}"].combined[0] for name in HOLDERS}
        axes = " + ".join(rows["rates-sta"].axes)
        marks.append(text(f"{title}, {axes}", (32, top), (0, -14), "small", "quiet"))
        for k, (name, colour) in enumerate(HOLDERS.items()):
            end, height = 166 + LONGEST * errors[name] / max(errors.values()), top + 12 + 30 * k
            marks.append(text(f"held by {name}", (32, height), (0, 5), "small"))
            marks.append(line(colour, [(166, height), (end, height)], 14.0, cap="butt"))
            marks.append(text(f"{errors[name]:.3g} mm", (end, height), (8, 5), "small"))
    description = (
        "Bars: the largest error of the head over the suites head and head3d, with resolved rates "
        "over the paper's law, over a law that foresees the joints, and over the oracle. In the "
        "plane the oracle leaves a third of the error, in space nearly all of it."
    )
    return document((640, 310), "How much of the head's error is the body's", description, marks)


DRAWINGS = {
    "robot.svg": lambda: robot_drawing(Robot()),
    "eely.svg": lambda: spatial_robot_drawing(EELY),
    "control_loop.svg": control_loop,
    "joint_motion.svg": joint_motion,
    "held_by.svg": held_by,
}


if __name__ == "__main__":
    for name, draw in DRAWINGS.items():
        Path(__file__).with_name(name).write_text(draw(), encoding="utf-8", newline="\n")
