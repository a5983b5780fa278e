"""`usm record`: write a dataset of a policy's episodes."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from importlib.metadata import version
from typing import Any, cast

import gymnasium as gym
from usm_agents.policies import named
from usm_baselines.contender import Contender

from usm_cli.options import add_mode, check_installed, count, parse_conditions
from usm_cli.selection import POLICIES
from usm_cli.terminal import output_console, progress_bar
from usm_gym.dataset import new_dataset, record, reset_seeds
from usm_gym.envs.env import TrackingEnv
from usm_gym.evaluation import batches
from usm_gym.registration import id_of
from usm_gym.support.provenance import provenance
from usm_gym.support.validation import UsageError, in_one_line
from usm_gym.task.conditions import PRESETS

DESCRIPTION = """\
Write the episodes of a policy as a dataset of Minari, for offline learning: observations, actions,
rewards, ends and infos as the environment gives them. Scenarios are sampled as for usm evaluate,
but from streams of their own: no evaluation and no frozen suite ever meets them. Minari keeps
datasets in MINARI_DATASETS_PATH (default: ~/.minari/datasets). A dataset that is there is never
overwritten, and an interruption leaves none. Needs the extra `datasets`.
"""
EXAMPLES = f"""\
{POLICIES}
examples:
  usm record sta --output usm/operation/sta-v0          fifty episodes
  usm record lqg-joints-basin --conditions basin --output usm/operation/basin-v0
  usm record mine --mode torpedo --episodes 500 --output usm/torpedo/mine-v0
"""


def add_to(subparsers: Any) -> None:
    """Add the command."""
    parser = subparsers.add_parser(
        "record",
        help="write a dataset for offline learning",
        description=DESCRIPTION,
        epilog=EXAMPLES,
    )
    add = parser.add_argument
    add("policy", metavar="POLICY", help="name of a policy")
    add("--episodes", type=int, metavar="N", help="number of episodes (default: 50)")
    add_mode(parser)
    add("--conditions", metavar="C", help=f"{', '.join(PRESETS)}, or JSON (default: field)")
    add("--seed", type=int, metavar="S", help="seed of the scenarios (default: 0)")
    add("--output", metavar="ID", required=True, help="id of the dataset: NAMESPACE/NAME-vN")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """Record, write, print where it is."""
    check_installed("usm record", "datasets", "minari", "h5py")
    episodes, seed = count(arguments, "episodes", 50), count(arguments, "seed", 0, least=0)
    conditions = parse_conditions(arguments.conditions or "field", arguments.mode)
    made = gym.make(f"usm_gym:{id_of(arguments.mode)}", conditions=asdict(conditions))
    env = cast(TrackingEnv, made.unwrapped)
    contender = named(arguments.policy)
    contender.make(env.nominal)
    about = {
        "algorithm_name": contender.name,
        "requirements": [f"usm-gym=={version('usm-gym')}"],
        "provenance": provenance({"seed": seed}),
    }
    drawn = reset_seeds(seed, episodes)
    steps = lost = 0
    with new_dataset(arguments.output, made, about) as add, progress_bar() as bar:
        line = bar.add_task("episodes", total=episodes)
        for part in batches(episodes):
            done = recorded(contender, env, drawn[part], lambda some: bar.advance(line, some))
            add(done)
            steps += sum(map(len, done))
            lost += sum(bool(episode.terminations[-1]) for episode in done)
    output_console().print(
        f"{arguments.output}: {episodes} episodes of {contender.name}, {lost} lost, {steps} steps",
        markup=False,
        highlight=False,
    )


def recorded(contender: Contender, env: TrackingEnv, seeds: list[int], progress: Any) -> list[Any]:
    """Record episodes side by side.

    Raises:
        ValueError: If the policy fails to act.
    """
    policy = contender.make(env.nominal)
    try:
        return record(policy, env, seeds, progress)
    except contender.refusals as error:
        kind = "" if isinstance(error, ValueError) else f"{type(error).__name__}: "
        raise UsageError(f"{contender.name} is refused: {kind}{in_one_line(error)}") from error
