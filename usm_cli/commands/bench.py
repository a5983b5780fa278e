"""`usm bench`: measure speed against peers in one run."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import gymnasium as gym
from rich.table import Table

from usm_cli import environment_speed as environments
from usm_cli import speed as benchmark
from usm_cli.decisions import decision_times, policies
from usm_cli.mujoco_chains import mujoco_timing, planar_chain, spatial_chain
from usm_cli.speed import (
    BATCH_PERIOD,
    ROBOTS,
    SINGLE_PERIOD,
    STEPS,
    Figure,
    Growth,
    SpeedResult,
    Timing,
    evaluate_suite,
    summarise,
)
from usm_cli.terminal import empty_table, output_console, progress_bar
from usm_gym.robot import Robot
from usm_gym.spatial_robot import EELY
from usm_gym.support.files import check_writable
from usm_gym.support.results import Provenance
from usm_gym.support.text import figures
from usm_gym.support.validation import require
from usm_gym.task.conditions import FIELD
from usm_gym.task.modes import AnyMode

DESCRIPTION = """\
Measure the speed on this machine. Figures and their peers are measured in the same run, in turns,
round by round. Prints medians with the smallest and largest values, and names the peers that are
not installed (extra `bench`). Finer physics steps have their price beside the error that they
leave, against the finest. The last tables say how long every policy takes to decide for one robot,
in the plane and in space.
Takes some minutes; let the machine do nothing else meanwhile.
"""

PEERS = {
    "plant_step_ratio_mujoco": ("mujoco_step_ns", "plant_step_ns"),
    "batch_step_ratio_mujoco": ("mujoco_step_ns", "batch_step_ns"),
    "spatial_step_ratio_mujoco": ("spatial_mujoco_step_ns", "spatial_step_ns"),
    "spatial_batch_step_ratio_mujoco": ("spatial_mujoco_step_ns", "spatial_batch_step_ns"),
    "vector_env_ratio_swimmer_v5": ("swimmer_v5_step_ns", "vector_env_step_ns"),
    "vector_env_ratio_sync": ("sync_vector_env_step_ns", "vector_env_step_ns"),
    "vector_env_ratio_cartpole": ("cartpole_vector_env_step_ns", "vector_env_step_ns"),
    "second_thread_speedup": ("vector_env_step_ns", "vector_env_two_threads_step_ns"),
}
# The modes in which decisions are timed: one in the plane, one in space.
MAIN_MODES: tuple[AnyMode, ...] = ("operation", "operation3d")
# The policy that decides where one does.
POLICY = "sta"
# Environment steps per second, and the cost of one that they follow from.
RATES = {
    "env_steps_per_s": "env_step_ns",
    "env_policy_steps_per_s": "env_policy_step_ns",
    "vector_env_steps_per_s": "vector_env_step_ns",
    "vector_env_policy_steps_per_s": "vector_env_policy_step_ns",
    "swimmer_v5_steps_per_s": "swimmer_v5_step_ns",
}
MEANINGS = {
    "env_steps_per_s": "environment steps per second, one robot, `gym.make`, random thrust",
    "env_policy_steps_per_s": f"the same with the policy {POLICY}",
    "vector_env_steps_per_s": f"environment steps per second, {ROBOTS} robots, one thread, in all",
    "vector_env_policy_steps_per_s": f"the same with the policy {POLICY}",
    "swimmer_v5_steps_per_s": "the same of Gymnasium's Swimmer-v5, `gym.make`, random actions",
    "env_step_ns": "environment step of one robot, `gym.make`, ns",
    "env_policy_step_ns": f"the same with the policy {POLICY}, ns",
    "plant_step_ns": "physics step of one robot, ns",
    "batch_step_ns": f"physics step, {ROBOTS} robots, one thread, per robot, ns",
    "mujoco_step_ns": "MuJoCo, C loop, Euler, the same chain, ns",
    "spatial_step_ns": "physics step of one robot in space (Eely, 9 links), ns",
    "spatial_batch_step_ns": f"the same, {ROBOTS} robots, one thread, per robot, ns",
    "spatial_mujoco_step_ns": "MuJoCo, C loop, Euler, the same chain in space, ns",
    "spatial_mujoco_implicitfast_step_ns": "the same with the integrator implicitfast, ns",
    "vector_env_step_ns": f"environment step, {ROBOTS} robots, one thread, per robot, ns",
    "vector_env_policy_step_ns": f"the same with the policy {POLICY}, ns",
    "vector_env_two_threads_step_ns": f"environment step, {ROBOTS} robots, on two threads, ns",
    "spatial_vector_env_step_ns": f"the same in space, {ROBOTS} robots, one thread, ns",
    "episode_start_us": "start of an episode in the vector environment, us",
    "sync_vector_env_step_ns": "SyncVectorEnv of 8 of our environments, per robot, ns",
    "swimmer_v5_step_ns": "Gymnasium's Swimmer-v5, ns",
    "cartpole_vector_env_step_ns": f"Gymnasium's CartPole vector environment, {ROBOTS}, ns",
    "plant_step_ratio_mujoco": "MuJoCo / physics step of one robot",
    "batch_step_ratio_mujoco": "MuJoCo / physics step in a batch",
    "spatial_step_ratio_mujoco": "MuJoCo, Euler / physics step of one robot in space",
    "spatial_batch_step_ratio_mujoco": "MuJoCo, Euler / physics step in a batch in space",
    "vector_env_ratio_swimmer_v5": "Swimmer-v5 / environment step (20 physics steps)",
    "vector_env_ratio_sync": "SyncVectorEnv / native vector environment",
    "vector_env_ratio_cartpole": "CartPole vector environment / ours",
    "second_thread_speedup": "one thread / two threads",
    **{
        f"step_{step}_second_us": f"simulated second at a step of {step}, {ROBOTS} robots, each, us"
        for step in STEPS
    },
    **{
        f"step_{step}_error_nm": f"error that a step of {step} makes in the position of lqg, nm"
        for step in list(STEPS)[:-1]
    },
    "paper_rate_40s_s": "40 s at 1e-5 s with observer and STA, s",
    "evaluate_suite_s": "operation suite, six policies, s",
    "evaluate_suite_3d_s": "operation3d suite, six policies, s",
    "thousand_episodes_s": "1000 operation episodes of 40 s with sta, s",
    "cold_start_s": "start of Python to first step, warm kernel cache, s",
    "compile_s": "the same with an empty cache, s",
}


def add_to(subparsers: Any) -> None:
    """Add the command."""
    parser = subparsers.add_parser(
        "bench",
        help="measure speed against peers",
        description=DESCRIPTION,
    )
    parser.add_argument(
        "--rounds", type=int, default=15, metavar="N", help="rounds of measurements (default: 15)"
    )
    parser.add_argument(
        "--growth", action="store_true", help="also measure 4 to 64 links and 1 to 4096 robots"
    )
    parser.add_argument("--output", metavar="FILE", help="write the figures as JSON")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """Measure, print, write."""
    rounds = arguments.rounds
    require(1 <= rounds <= 10_000, "--rounds", rounds, "1 to 10000")
    if arguments.output:
        check_writable(arguments.output)
    timings, missing = available()
    seconds = whole_jobs()
    with progress_bar() as bar:
        total = bar.add_task("rounds", total=rounds + len(seconds))
        times = benchmark.interleaved(timings, rounds, lambda: bar.advance(total))
        for name, (job, repeats) in seconds.items():
            bar.update(total, description=name)
            times[name] = [job() for _ in range(repeats)]
            bar.advance(total)
    measured = {name: summarise(values) for name, values in times.items()}
    for step, error in benchmark.loop_errors().items():
        measured[f"step_{step}_error_nm"] = summarise([error])
    for rate, cost in RATES.items():
        if cost in times:
            measured[rate] = summarise([1e9 / ns for ns in times[cost]])
    for ratio, (slow, fast) in PEERS.items():
        if slow in times:
            pairs = zip(times[slow], times[fast], strict=True)
            measured[ratio] = summarise([a / b for a, b in pairs])
    console = output_console()
    console.print(table(measured, missing))
    console.print(*findings(measured), sep="\n\n")
    rows = list(benchmark.growth(min(rounds, 5))) if arguments.growth else []
    if rows:
        console.print(growth_table(rows))
    decisions = {}
    for mode in MAIN_MODES:
        decisions[mode] = decision_times(policies(mode), min(rounds, 5), mode=mode)
        console.print(decisions_table(mode, decisions[mode]))
    if arguments.output:
        result = SpeedResult(
            medians={name: figure.median for name, figure in measured.items()},
            spread=measured,
            missing=tuple(missing),
            growth=tuple(rows),
            decisions=decisions["operation"],
            spatial_decisions=decisions["operation3d"],
            machine=benchmark.machine(),
            provenance=Provenance.here({"rounds": rounds}),
        )
        result.write(arguments.output)


def available() -> tuple[list[Timing], list[str]]:
    """The timings that can run here, and the names of those that lack a package."""
    makers: dict[str, Callable[[str], Timing]] = {
        "plant_step_ns": lambda name: benchmark.plant_timing(name, 1, SINGLE_PERIOD),
        "batch_step_ns": lambda name: benchmark.plant_timing(name, ROBOTS, BATCH_PERIOD),
        "mujoco_step_ns": lambda name: mujoco_timing(name, 2000, planar_chain(Robot())),
        "spatial_step_ns": partial(
            benchmark.plant_timing, size=1, period=SINGLE_PERIOD, mode="operation3d"
        ),
        "spatial_batch_step_ns": partial(
            benchmark.plant_timing, size=ROBOTS, period=BATCH_PERIOD, mode="operation3d"
        ),
        "spatial_mujoco_step_ns": lambda name: mujoco_timing(
            name, 2000, spatial_chain(EELY, "Euler")
        ),
        "spatial_mujoco_implicitfast_step_ns": lambda name: mujoco_timing(
            name, 300, spatial_chain(EELY, "implicitfast")
        ),
        "spatial_vector_env_step_ns": partial(
            environments.spatial_vector_timing, size=ROBOTS, steps=50
        ),
        "env_step_ns": partial(environments.single_timing, steps=500),
        "env_policy_step_ns": partial(environments.swimming_timing, id=POLICY, steps=500),
        "vector_env_step_ns": partial(environments.vector_timing, size=ROBOTS, steps=100),
        "vector_env_policy_step_ns": partial(
            environments.swimming_vector_timing, id=POLICY, size=ROBOTS, steps=100
        ),
        "vector_env_two_threads_step_ns": partial(
            environments.vector_timing, size=ROBOTS, steps=100, threads=2
        ),
        "sync_vector_env_step_ns": partial(environments.sync_timing, size=8, steps=50),
        "episode_start_us": partial(environments.start_timing, size=64),
        "swimmer_v5_step_ns": partial(environments.swimmer_timing, steps=500),
        "cartpole_vector_env_step_ns": partial(
            environments.cartpole_timing, size=ROBOTS, steps=200
        ),
        **{
            f"step_{step}_second_us": partial(benchmark.second_timing, step=size)
            for step, size in STEPS.items()
        },
    }
    timings, missing = [], []
    for name, maker in makers.items():
        try:
            timings.append(maker(name))
        except (ImportError, gym.error.Error):
            missing.append(name)
    return timings, missing


def whole_jobs() -> dict[str, tuple[Callable[[], float], int]]:
    """Jobs that are timed as a whole, with their numbers of repetitions."""
    benchmark.paper_rate()  # compiles what is not yet compiled
    return {
        "paper_rate_40s_s": (lambda: benchmark.timed(benchmark.paper_rate), 3),
        "evaluate_suite_s": (lambda: benchmark.timed(partial(evaluate_suite, "operation")), 3),
        "evaluate_suite_3d_s": (
            lambda: benchmark.timed(partial(evaluate_suite, "operation3d")),
            3,
        ),
        "thousand_episodes_s": (lambda: benchmark.timed(benchmark.thousand_episodes), 1),
        "cold_start_s": (lambda: benchmark.first_step(compile_anew=False), 5),
        "compile_s": (lambda: benchmark.first_step(compile_anew=True), 1),
    }


def table(measured: dict[str, Figure], missing: list[str]) -> Table:
    """The figures for the terminal."""
    rows = empty_table("figure", "what it is", numbers=("median", "smallest", "largest"))
    for name, meaning in MEANINGS.items():
        if name in measured:
            figure = measured[name]
            rows.add_row(name, meaning, *map(figures, (figure.median, figure.low, figure.high)))
        elif name in missing:
            rows.add_row(name, f"{meaning}: not installed (the extra bench)")
    return rows


def findings(measured: Mapping[str, Figure]) -> list[str]:
    """What the figures say of environment steps, in sentences; of those that were measured."""
    rates = {name: measured[name].median for name in RATES if name in measured}
    said = []
    if {"env_steps_per_s", "env_policy_steps_per_s"} <= set(rates):
        said.append(
            f"One robot makes {rounded(rates['env_steps_per_s'])} environment steps per second "
            "through `gym.make`, on one core, and "
            f"{rounded(rates['env_policy_steps_per_s'])} with `{POLICY}` as its policy."
        )
    if {"vector_env_steps_per_s", "vector_env_policy_steps_per_s"} <= set(rates):
        alone = rates["vector_env_steps_per_s"]
        said.append(
            f"{ROBOTS} robots side by side make {rounded(alone)} through `gym.make_vec`, on one "
            f"core, and {rounded(rates['vector_env_policy_steps_per_s'])} with `{POLICY}`: "
            f"{rounded(alone * FIELD.substeps)} physics steps per second, or "
            f"{rounded(alone * FIELD.control_period)} times real time."
        )
    return said


def rounded(rate: float) -> str:
    """Write a rate with two significant figures: 8,700."""
    return f"{float(f'{rate:.2g}'):,.0f}"


def growth_table(rows: list[Growth]) -> Table:
    """The growth of the cost, for the terminal."""
    headings = ("links", "robots", "threads", "ns per robot and step", "ns per link")
    table = empty_table(numbers=headings)
    for row in rows:
        counts = [str(count) for count in (row.links, row.robots, row.threads)]
        table.add_row(*counts, figures(row.ns), figures(row.ns / row.links))
    return table


def decisions_table(mode: str, decisions: Mapping[str, Figure]) -> Table:
    """How long policies take for a decision in a mode, the fastest first, for the terminal."""
    table = empty_table(f"policy, {mode}", numbers=("us per decision", "smallest", "largest"))
    for id, figure in sorted(decisions.items(), key=lambda pair: pair[1].median):
        table.add_row(id, *map(figures, (figure.median, figure.low, figure.high)))
    return table
