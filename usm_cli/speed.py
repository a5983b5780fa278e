"""Measures speed against peers in one run: interleaved rounds, medians, spread."""

from __future__ import annotations

import os
import platform
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from usm_baselines.paper.paper_rate import Law, simulate
from usm_baselines.registry import make

from usm_gym.evaluation import evaluate, rollout
from usm_gym.recording import Trajectory
from usm_gym.robot import Robot, Thruster
from usm_gym.simulation import Simulation
from usm_gym.suites import suite
from usm_gym.support.results import Part, Provenance, Result
from usm_gym.support.seeding import EVALUATION, stream
from usm_gym.support.validation import Count, Number, require, validated
from usm_gym.task.conditions import FIELD, Conditions
from usm_gym.task.head_path import HeadPath
from usm_gym.task.head_scenario import HeadEpisode
from usm_gym.task.modes import AnyMode, AnyScenario, presets_of, sample_of
from usm_gym.task.sampling import named, sample
from usm_gym.task.scenario import Path as Track
from usm_gym.task.spatial_scenario import SpatialPath, SpatialScenario

ROBOTS = 256
SINGLE_PERIOD, BATCH_PERIOD = 1.0, 0.1
# Physics steps that are priced, s; the last is what the others are compared with.
STEPS = {"2ms": 2e-3, "1ms": 1e-3, "500us": 5e-4, "100us": 1e-4}
LOOPS, LOOP_TIME = 8, 15.0
FIRST_STEP = """
import gymnasium, usm_gym
env = gymnasium.make("usm_gym:USM-Operation-v0")
env.reset(seed=0)
env.step(env.action_space.sample())
"""


@dataclass(frozen=True)
class Timing:
    """A piece of work to time.

    Attributes:
        name: Key of its figure.
        run: Does the work once.
        units: Units of work in it.
        scale: Factor from seconds per unit to the figure: 1e9 for ns.
    """

    name: str
    run: Callable[[], object]
    units: float
    scale: float = 1e9


@validated
class Figure:
    """A measured figure.

    Attributes:
        median: Median over rounds.
        low: Smallest.
        high: Largest.
    """

    median: Number
    low: Number
    high: Number


@validated
class Growth:
    """The cost of a physics step at some size.

    Attributes:
        links: Links of a robot.
        robots: Robots side by side.
        threads: Threads.
        ns: Cost per robot and step, ns.
    """

    links: Count
    robots: Count
    threads: Count
    ns: Number


@validated
class Machine:
    """The machine of the measurements.

    Attributes:
        processor: Its processor.
        cores: Number of its cores, if known.
        system: Its operating system.
    """

    processor: str
    cores: int | None
    system: str


@validated
class SpeedResult(Part, Result):
    """The figures of `usm bench`.

    Attributes:
        medians: Medians of the figures; in JSON they are beside the other fields.
        spread: The figures with their spread.
        missing: Figures that need a package that is not installed.
        growth: Costs for more links, robots and threads, if measured.
        machine: The machine.
        provenance: The origin of the figures.
        decisions: How long policies take for a decision, for one robot in the plane, us.
        spatial_decisions: The same in space.
    """

    kind: ClassVar[str] = "bench"
    marked: ClassVar[bool] = False
    beside: ClassVar[str] = "medians"
    medians: Mapping[str, Number]
    spread: Mapping[str, Figure]
    missing: tuple[str, ...]
    growth: tuple[Growth, ...]
    machine: Machine
    provenance: Provenance
    decisions: Mapping[str, Figure]
    spatial_decisions: Mapping[str, Figure]

    def __post_init__(self) -> None:
        """Refuse medians of other figures."""
        names = list(self.spread)
        require(list(self.medians) == names, "medians", list(self.medians), ", ".join(names))


def summarise(values: Any) -> Figure:
    """Summarise the rounds of one figure."""
    low, high = float(np.min(values)), float(np.max(values))
    return Figure(median=float(np.median(values)), low=low, high=high)


def interleaved(
    timings: list[Timing], rounds: int, progress: Callable[[], object]
) -> dict[str, list[float]]:
    """Time everything once per round, after one run that does not count."""
    for timing in timings:
        timing.run()
    times: dict[str, list[float]] = {timing.name: [] for timing in timings}
    for _ in range(rounds):
        for timing in timings:
            begin = time.perf_counter()
            timing.run()
            times[timing.name].append((time.perf_counter() - begin) / timing.units * timing.scale)
        progress()
    return times


def plant_timing(
    name: str,
    size: int,
    period: float,
    threads: int = 1,
    robot: Robot | None = None,
    step: float = FIELD.physics_step,
    mode: AnyMode = "operation",
) -> Timing:
    """Time physics steps of `size` robots, per robot and step, with moving joints.

    They have no thrust, so their reference rests; otherwise they would be lost.
    """
    conditions = replace(still_water(mode), control_period=period, physics_step=step)
    simulation = Simulation(resting(size, conditions, robot, mode), threads)
    start = simulation.snapshot()
    action = np.zeros((size, simulation.world.actions), np.float32)

    def run() -> None:
        if simulation.count[0] == simulation.steps[0]:
            simulation.restore(start)
        simulation.step(action)

    return Timing(name, run, size * conditions.substeps)


def second_timing(name: str, step: float) -> Timing:
    """Time simulated seconds of `ROBOTS` robots at a physics step, per robot; us."""
    steps = plant_timing(name, ROBOTS, BATCH_PERIOD, step=step)
    return replace(steps, units=ROBOTS * BATCH_PERIOD, scale=1e6)


def still_water(mode: AnyMode) -> Conditions:
    """The conditions `field` of a mode, without a current."""
    return replace(presets_of(mode)["field"], current_limit=0.0)


def resting(
    size: int, conditions: Conditions, robot: Robot | None = None, mode: AnyMode = "operation"
) -> list[AnyScenario]:
    """Sample scenarios with a resting reference, so that no controller is needed."""
    scenarios = [
        at_rest(sample_of(mode, conditions, stream(0, EVALUATION, i), robot))
        for i in range(min(size, 64))
    ]
    return [scenarios[i % len(scenarios)] for i in range(size)]


def at_rest(scenario: AnyScenario) -> AnyScenario:
    """A scenario whose reference stays where it starts."""
    if isinstance(scenario, HeadEpisode):
        return replace(scenario, path=HeadPath(centre=tuple(scenario.start.tolist())))
    if isinstance(scenario, SpatialScenario):
        return replace(scenario, path=SpatialPath(speed=0.0, sway=0.0, heave=0.0))
    return replace(scenario, path=Track(speed=0.0, amplitude=0.0))


def paper_rate() -> None:
    """Run 40 s at 1e-5 s with observer and super-twisting controller in every step."""
    scenario = named("table1", "operation")
    conditions = replace(scenario.conditions, control_period=1e-5, physics_step=1e-5)
    simulate(replace(scenario, conditions=conditions), Law())


def evaluate_suite(name: str) -> None:
    """Score six policies on a suite."""
    scenarios = suite(name)
    nominal = scenarios[0].nominal
    for id in ("sta", "sta-explicit", "pd", "pd-mass", "pd-observer", "zero"):
        evaluate(make(id, nominal), scenarios)


def thousand_episodes() -> None:
    """Score the super-twisting controller on a thousand sampled operation episodes of 40 s."""
    scenarios = [sample("operation", Conditions(), stream(1, EVALUATION, i)) for i in range(1000)]
    evaluate(make("sta", scenarios[0].nominal), scenarios)


def closed_loops(step: float) -> list[Trajectory]:
    """Run `lqg` through the beginnings of operation episodes, up to a motion of the joints."""
    scenarios = [
        replace(
            scenario,
            duration=LOOP_TIME,
            conditions=replace(scenario.conditions, physics_step=step),
        )
        for scenario in suite("operation")[:LOOPS]
    ]
    return rollout(make("lqg", scenarios[0].nominal), scenarios)


def loop_errors() -> dict[str, float]:
    """How far each step but the last of `STEPS` takes `lqg` from where the last does, nm."""
    *positions, exact = (
        np.stack([trajectory.error for trajectory in closed_loops(step)]) for step in STEPS.values()
    )
    errors = [1e9 * float(np.abs(position - exact).max()) for position in positions]
    return dict(zip(STEPS, errors, strict=False))


def timed(job: Callable[[], object]) -> float:
    """Time a job, s."""
    begin = time.perf_counter()
    job()
    return time.perf_counter() - begin


def first_step(compile_anew: bool) -> float:
    """Time from starting Python to the first step, s, with a warm or an empty kernel cache."""
    with tempfile.TemporaryDirectory() as empty:
        environment = {**os.environ, **({"NUMBA_CACHE_DIR": empty} if compile_anew else {})}
        begin = time.perf_counter()
        subprocess.run([sys.executable, "-c", FIRST_STEP], env=environment, check=True)
        return time.perf_counter() - begin


def growth(rounds: int) -> Iterator[Growth]:
    """Measure the cost per robot and physics step, ns, for more links, robots and threads."""
    for links in (4, 8, 16, 32, 64):
        body = growing_robot(links)
        for name, size, period in (("single", 1, SINGLE_PERIOD), ("batch", ROBOTS, BATCH_PERIOD)):
            figure = _alone(plant_timing(name, size, period, robot=body), rounds)
            yield Growth(links=links, robots=size, threads=1, ns=figure)
    for size in (1, 8, 64, 512, 4096):
        for threads in (1, 2):
            figure = _alone(plant_timing("batch", size, 0.02, threads), rounds)
            yield Growth(links=16, robots=size, threads=threads, ns=figure)


def growing_robot(links: int) -> Robot:
    """Make a robot of any number of links, with thrusters in the paper's places."""
    places = sorted({1, *(max(2, round(links * place / 16)) for place in (3, 6, 11, 14))})
    normal = tuple(Thruster(link, "normal") for link in places)
    return Robot(links=links, thrusters=(Thruster(1, "axial"), *normal))


def _alone(timing: Timing, rounds: int) -> float:
    return summarise(interleaved([timing], rounds, lambda: None)[timing.name]).median


def machine() -> Machine:
    """Describe this machine."""
    model = platform.processor() or platform.machine()
    information = Path("/proc/cpuinfo")
    if information.exists():
        for line in information.read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                model = line.split(":", 1)[1].strip()
                break
    return Machine(processor=model, cores=os.cpu_count(), system=platform.platform())
