"""Names become policies, or one clear line."""

import json
import re
import sys
from pathlib import Path
from typing import Any

import pytest
from support.episodes import short
from usm_baselines.contender import contender

import usm_gym
from usm_gym.policy import is_privileged
from usm_gym.task.sampling import named

NOMINAL = named("nominal", "operation").nominal
PAGE = Path(__file__).parents[2] / "docs" / "own_controller.md"
FAULTY = """
class Plain:
    def __init__(self, gain=2.0):
        self.gain = gain
    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        return observation[:, :5], state
class Knowing(Plain):
    def __init__(self, gain=2.0, nominal=None):
        self.nominal = nominal
class Needy(Plain):
    def __init__(self, knowledge):
        self.nominal = knowledge
def factory():
    return Plain(7.0)
class Seer(Plain):
    privileged = True
class SecretSeer(Plain):
    def __init__(self):
        self.privileged = True
class Mute: ...
class Short(Plain):
    def predict(self, observation): ...
class Broken(Plain):
    def __init__(self):
        raise OSError("no\\nweights")
"""


@pytest.fixture
def mine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    (tmp_path / "faulty.py").write_text(FAULTY)
    (tmp_path / "wrong.py").write_text("import nothing_of_the_kind")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.delitem(sys.modules, "faulty", raising=False)
    return "faulty"


def gains_file(folder: Path, policy: str = "sta", **gains: Any) -> Path:
    path = folder / f"{policy}.json"
    data = {"policy": policy, "gains": gains, "budget": {"trials": 3, "episodes": 2}, "weight": 0.1}
    path.write_text(json.dumps(data))
    return path


def test_an_id_is_the_registered_policy_and_a_file_gives_it_gains(tmp_path: Path) -> None:
    path = gains_file(tmp_path, surface=3.0)
    plain: Any = contender("sta").make(NOMINAL)
    given: Any = contender(f"sta@{path}").make(NOMINAL)
    assert given.gains == plain.gains._replace(surface=3.0)


def test_what_scores_depend_on_changes_with_the_gains_and_not_with_the_file(tmp_path: Path) -> None:
    first = contender(f"sta@{gains_file(tmp_path, surface=3.0)}").identity
    other = tmp_path / "elsewhere"
    other.mkdir()
    assert contender(f"sta@{gains_file(other, surface=3.0)}").identity == first
    found = {first, contender("sta").identity, contender("sta-explicit").identity}
    found.add(contender(f"sta@{gains_file(tmp_path, surface=4.0)}").identity)
    assert len(found) == 4


def test_a_controller_of_ones_own_is_given_the_nominal_knowledge_if_it_asks(mine: str) -> None:
    def make(name: str) -> Any:
        found = contender(f"{mine}:{name}")
        assert found.identity is None  # its code may change at any time
        return found.make(NOMINAL)

    assert make("Plain").gain == 2.0
    assert make("Knowing").nominal is NOMINAL
    assert make("Needy").nominal is NOMINAL
    assert make("factory").gain == 7.0


def test_a_controller_of_ones_own_that_is_given_true_state_is_no_competitor(mine: str) -> None:
    seer, plain = contender(f"{mine}:Seer"), contender(f"{mine}:Plain")
    assert (seer.privileged, plain.privileged) == (True, False)
    assert is_privileged(seer.make(NOMINAL))


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("nobody", "nobody"),
        ("absent:Plain", "No module named 'absent'"),
        ("wrong:Plain", "No module named 'nothing_of_the_kind'"),
        ("faulty:Plan", "'Plan'; allowed: a class or factory in faulty, which has Plain, Knowing"),
        ("faulty:Mute", "predict(observation, state=None"),
        ("faulty:Short", "too many positional arguments"),
        ("faulty:Broken", "cannot be made: OSError: no weights"),
        ("faulty:SecretSeer", "privileged of policy faulty:SecretSeer is True; allowed: False"),
        ("sta@pd.json", "policy of pd.json is 'pd'; allowed: sta"),
        ("sta@wrong.json", "wrong.json is no file of gains"),
        ("sta@odd.json", "odd.json is no file of gains"),
        ("sta@sta.json", "stiffness"),
    ],
)
def test_what_is_missing_is_said(mine: str, name: str, said: str) -> None:
    gains_file(Path(), "pd")
    gains_file(Path(), stiffness=3.0)
    Path("wrong.json").write_text("{")
    Path("odd.json").write_text('{"policy": "sta", "gains": {"surface": "high"}}')
    with pytest.raises(ValueError, match=re.escape(said)):
        contender(name).make(NOMINAL)


def test_the_examples_in_the_documentation_work_when_copied(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    saved = re.findall(r"Save this as `(.+?)`:\n\n```python\n(.*?)```", PAGE.read_text(), re.DOTALL)
    for name, code in saved:
        (tmp_path / name).write_text(code)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    names = "zero", "my_controller:MyPD", "my_lqr:MyLQR"
    scenarios = short(4, duration=8.0)
    errors = [
        usm_gym.evaluate(contender(name).make(NOMINAL), scenarios).per_episode["max_error_x"].mean()
        for name in names
    ]
    assert errors[2] < errors[1] < 0.1 * errors[0]
    lines = {name: len([*filter(None, code.splitlines())]) for name, code in saved}
    assert (lines["my_controller.py"], lines["my_lqr.py"] <= 30) == (8, True)
