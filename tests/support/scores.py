"""Scores of a few frozen episodes, and the first second of Table 1, computed anew.

`python tests/support/scores.py` records them anew, for changes that are meant to alter results.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import usm_agents  # noqa: F401  (registers the shipped agents)
import usm_baselines
from usm_baselines.paper.paper_rate import simulate
from usm_baselines.paper.reproduction import cases

import usm_gym

FILE = Path(__file__).parents[1] / "data" / "scores.json"
# By suite, the episode of it.
EPISODES = {"operation": 0, "operation-basin": 1, "torpedo": 2, "operation3d": 3, "torpedo3d": 4}
IN_THE_PLANE = (
    "sta",
    "pd",
    "pid",
    "gsta-tuned",
    "lqg-joints-tuned",
    "mpc",
    "residual-ppo",
    "estimator-lqg-joints",
)
IN_SPACE = ("sta", "pd", "sta-lag-eely", "lqg-joints-eely")
PAIRS = [
    (suite, policy)
    for suite in EPISODES
    for policy in (IN_SPACE if suite.endswith("3d") else IN_THE_PLANE)
]


def scores(policy: str, suite: str) -> dict[str, float]:
    """Every metric of a policy in the episode of a suite."""
    scenario = usm_gym.suite(suite)[EPISODES[suite]]
    made = usm_baselines.make(policy, scenario.nominal)
    metrics = usm_gym.evaluate(made, [scenario]).summary()["per_episode"]
    return {name: values[0] for name, values in metrics.items()}


def first_second() -> dict[str, dict[str, Any]]:
    """By row of Table 1 in operation mode, where the first second at the paper's step ends."""
    ends = {}
    for case in cases():
        if case.mode == "operation":
            record = simulate(replace(case.scenario, duration=1.0), case.law, every=100)
            ends[case.row] = {
                name: getattr(record, name)[-1].tolist()
                for name in ("error", "force", "sigma", "effort", "theta")
            }
    return ends


def recorded() -> dict[str, Any]:
    """What is kept in `FILE`."""
    kept: dict[str, Any] = json.loads(FILE.read_text(encoding="utf-8"))
    return kept


def main() -> None:
    """Record everything anew."""
    episodes: dict[str, dict[str, dict[str, float]]] = {suite: {} for suite in EPISODES}
    for suite, policy in PAIRS:
        episodes[suite][policy] = scores(policy, suite)
    now = {"episodes": episodes, "first_second": first_second()}
    FILE.write_text(json.dumps(now, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
