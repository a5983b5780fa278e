"""Plans: what cannot be trained is refused, and nothing of it needs torch."""

import re
import subprocess
import sys
import textwrap

import pytest
from usm_agents.learning.plan import Plan

from usm_cli.commands.train import OPTIONS


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"algorithm": "luck"}, "algorithm is 'luck'"),
        ({"algorithm": ":ppo"}, "algorithm is ':ppo'"),
        ({"env": "CartPole-v1"}, "env is 'CartPole-v1'"),
        ({"steps": 0}, "steps"),
        ({"seed": -1}, "seed"),
        ({"base": "os:system"}, "base is 'os:system'"),
    ],
)
def test_bad_plans_are_refused(fields, message):
    with pytest.raises(ValueError, match=message):
        Plan(**fields)


def test_the_help_states_the_defaults_of_a_plan():
    plan = Plan()
    for name, kind, _, text in OPTIONS:
        (stated,) = re.findall(r"\(default: (.*)\)", text)
        assert kind(stated) == getattr(plan, name)


def test_plans_and_training_need_no_torch():
    code = """
        import sys, usm_agents.learning.plan, usm_agents.learning.training, usm_cli.program
        try:
            usm_cli.program.main(["train", "--help"])
        except SystemExit:
            sys.exit(bool({"torch", "stable_baselines3", "tensorboard"} & set(sys.modules)))
    """
    subprocess.run([sys.executable, "-c", textwrap.dedent(code)], check=True, capture_output=True)
