"""Kill commands at every operation on files and at random moments, and compare what resumes leave.

    python tests/support/kills.py                          some minutes
    python tests/support/kills.py --every train            a training, killed at every write
    python tests/support/kills.py --kills 5 tune           a tuning, five times at random moments

Commands are small: few robots, few episodes of a second. Each runs in a forked child, so that none
imports or compiles anything again. A file that a child was killed at is left empty, half written
and whole. Leaves with status 1 if anything differs from what an undisturbed command leaves.
"""

import argparse
import io
import json
import os
import random
import shutil
import signal
import sys
import tempfile
import time
import traceback
from contextlib import redirect_stdout
from dataclasses import replace
from functools import cache, partial
from pathlib import Path

import regression  # noqa: F401 (registers a learner)
from matplotlib.figure import Figure
from usm_agents.learning import training, validation
from usm_agents.learning.plan import PLAN, Plan
from usm_agents.learning.settings import SETTINGS
from usm_agents.study import dissection, plans, scores, trainings
from usm_baselines import registry
from usm_baselines.benchmark import tuning
from usm_baselines.benchmark.leaderboard import PLANE, Board
from usm_baselines.space import Range

from usm_cli.program import main
from usm_gym.suites import suite
from usm_gym.support import provenance
from usm_gym.task.scenario import STILL

# Options of trainings. A round of the estimator has 200 steps.
TRAININGS = {
    "train": ["--algorithm", "sac", "--steps", "8", "--interval", "8"],
    "regression": ["--algorithm", "regression", "--steps", "8", "--interval", "8"],
    "estimator": [
        *("--algorithm", "estimator", "--action", "estimates", "--base", "lqg-joints"),
        *("--steps", "400", "--interval", "200"),
    ],
}
COMMANDS = {
    "tune": ["tune", "sta", "--trials", "20", "--episodes", "3", "--output", "sta.json"],
    "leaderboard": ["leaderboard", "--policies", "sta,pd", "--output", "mine"],
    "study": [
        *("study", "residual", "--only", "residual-ppo", "--seeds", "2", "--steps", "16"),
        *("--episodes", "4", "--output", "mine"),
    ],
}
SPACE = {"observer_gain": Range(0.1, 100.0, "m/s^3"), "surface": Range(0.1, 10.0, "1/s")}
CHANGES = {"os.rename", "os.remove", "os.rmdir", "os.mkdir", "os.chmod", "os.truncate"}


def brief(scenario):
    return replace(scenario, duration=1.0, settle_time=0.2, inspection=STILL)


def shrink():
    """Make all commands small, in this process."""
    os.fsync = lambda handle: None  # a kill is no power cut
    SETTINGS["sac"] |= {"robots": 4, "learning_starts": 4, "batch_size": 8, "buffer_size": 100}
    SETTINGS["estimator"] |= {"robots": 4, "units": 4, "hidden": 4, "batch": 2}
    training.train = partial(training.train, validation_episodes=2, test_episodes=2)
    trainings.train = training.train
    dissection.EPISODES = 2
    sample = Plan.scenario
    Plan.scenario = lambda plan, random: brief(sample(plan, random))
    for module in (validation, scores, dissection):
        module.unseen = lambda *of, unseen=module.unseen: [brief(each) for each in unseen(*of)]
    SETTINGS["ppo"] |= {"robots": 4, "n_steps": 2, "batch_size": 8}
    plans.RIVALS["field"] = ("sta", "zero")
    plans.ELSEWHERE["field"] = {"still": plans.ELSEWHERE["field"]["still"]}
    plans.PLANS["residual-ppo"] = replace(plans.PLANS["residual-ppo"], interval=8)
    dissection.SEGMENT, dissection.LONGEST_SHIFT = 16, 2
    registry._entries["sta"] = replace(registry._entries["sta"], space=SPACE)
    tuned = tuning.sample_of
    tuning.sample_of = lambda *of: brief(tuned(*of))
    frozen = [brief(each) for each in suite(PLANE.main)[:4]]
    Board.suites = lambda self: {PLANE.main: frozen[:2], "other": frozen[2:]}
    # Of pictures only the names are compared, and of provenance nothing.
    save = Figure.savefig
    Figure.savefig = lambda figure, file, **how: save(Figure(), file, **how)
    for name in ("_commit", "_version"):
        setattr(provenance, name, cache(getattr(provenance, name)))


def words(name):
    """The command as it is given, in the current folder, for the first time and again."""
    if name not in TRAININGS:
        return COMMANDS[name]
    options = ["--resume"] if Path("mine", PLAN).exists() else TRAININGS[name]
    return ["train", *options, "--output", "mine"]


def begin(name, folder, die=None):
    """Begin a command in a child, which `die` is called in before it does anything."""
    sys.stdout.flush()
    child = os.fork()
    if child:
        return child
    status = 1
    try:
        folder.mkdir(parents=True, exist_ok=True)
        os.chdir(folder)
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if die is not None:
            die(folder)
        main(words(name))
        status = 0
    except SystemExit as left:
        status = left.code
    except BaseException:
        traceback.print_exc()
    finally:
        os._exit(status or 0)


def warm_up(name, folder):
    """Carry out a command here, so that the children find everything imported and compiled."""
    folder.mkdir()
    before = os.getcwd()
    os.chdir(folder)
    with redirect_stdout(io.StringIO()):
        main(words(name))
    os.chdir(before)


def finished(child):
    """Wait for a child; whether it was killed is the answer."""
    status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    assert status in (0, -signal.SIGKILL), f"status {status}"
    return status == 0


def at_operation(number, torn):
    """Die before the operation of this number; `torn`: of those that follow the opening of a file
    to be written, and leave that file half written."""

    def die(folder):
        count, opened = 0, None

        def hook(event, arguments):
            nonlocal count, opened
            target = None
            if event == "open":
                path, _, flags = arguments
                if flags & (os.O_WRONLY | os.O_RDWR) and isinstance(path, str | os.PathLike):
                    target = Path(path).absolute()
                if target is None or not target.is_relative_to(folder):
                    return
            elif event not in CHANGES:
                return
            if not torn or opened is not None:
                count += 1
            before, opened = opened, target
            if count > number:
                count = -sys.maxsize  # what follows is no operation of the command
                if torn and before is not None and before.is_file():
                    os.truncate(before, before.stat().st_size // 2)
                os.kill(os.getpid(), signal.SIGKILL)

        sys.addaudithook(hook)

    return die


def plain(value):
    """A value of JSON without what differs from run to run: wall times, versions, commands."""
    if isinstance(value, dict):
        return {k: plain(v) for k, v in value.items() if k not in ("seconds", "provenance")}
    return [plain(each) for each in value] if isinstance(value, list) else value


def contents(folder):
    """What a command has left, by name; of checkpoints and pictures the names only."""
    found = {}
    for path in sorted(folder.rglob("*")):
        name = str(path.relative_to(folder))
        if path.name.startswith("events.out") or path.parent.name.startswith("checkpoint"):
            continue
        found[name] = None
        if path.suffix == ".json" and ".part" not in name:
            text = path.read_text().replace(str(folder), "")
            found[name] = plain(json.loads(text))
        elif path.suffix in (".csv", ".md", ".safetensors"):
            found[name] = path.read_bytes()
    # The names of kept scores are hashes of all they depend on, wall times included.
    kept = [found.pop(name) for name in list(found) if "cache/" in name]
    return {**found, "kept": sorted(json.dumps(each) for each in kept)}


def compare(name, whole, folder):
    """Let a command finish; whether it has left what an undisturbed one does."""
    assert finished(begin(name, folder)), "killed by somebody else"
    found = contents(folder)
    if found == whole:
        return True
    for key in sorted({*found, *whole}):
        if found.get(key, "none") != whole.get(key, "none"):
            print(f"{name} in {folder}: {key} differs", file=sys.stderr)
    return False


def everywhere(name, whole, folder):
    """Kill a command at each of its operations; how often, and after how many all was well."""
    kills = well = 0
    for torn in (False, True):
        number = 0
        while not finished(begin(name, folder / f"{number}-{torn}", at_operation(number, torn))):
            kills += 1
            well += compare(name, whole, folder / f"{number}-{torn}")
            shutil.rmtree(folder / f"{number}-{torn}")
            number += 1
    return kills, well


def anywhere(name, whole, folder, wanted, longest, chance):
    """Kill a command so often at random moments, also while it goes on from the kill before."""
    kills = well = runs = 0
    while kills < wanted:
        runs += 1
        while kills < wanted:
            child = begin(name, folder / str(runs))
            time.sleep(chance.uniform(0.0, longest))
            os.kill(child, signal.SIGKILL)
            if finished(child):
                break
            kills += 1
        well += compare(name, whole, folder / str(runs))
    return kills, runs, well


def run():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("commands", nargs="*", default=[*TRAININGS, *COMMANDS])
    parser.add_argument("--kills", type=int, default=20, help="at random moments, each command")
    parser.add_argument("--every", action="store_true", help="at every operation only")
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    shrink()
    good = True
    for name in arguments.commands:
        with tempfile.TemporaryDirectory() as scratch:
            folder = Path(scratch).resolve()
            warm_up(name, folder / "first")
            start = time.monotonic()
            finished(begin(name, folder / "whole"))
            longest = time.monotonic() - start
            whole = contents(folder / "whole")
            if name in TRAININGS:
                kills, well = everywhere(name, whole, folder / "every")
                print(f"{name}: killed at each of {kills} operations, {well} equal")
                good &= kills == well > 0
            if not arguments.every:
                chance = random.Random(arguments.seed)
                kills, runs, well = anywhere(
                    name, whole, folder / "any", arguments.kills, longest, chance
                )
                print(f"{name}: {kills} kills in {runs} runs of {longest:.1f} s, {well} runs equal")
                good &= runs == well
    sys.exit(not good)


if __name__ == "__main__":
    run()
