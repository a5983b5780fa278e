"""What `usm bench` says of what it has measured."""

import re

from usm_cli import environment_speed as environments
from usm_cli.commands.bench import RATES, findings, rounded
from usm_cli.speed import Figure, interleaved
from usm_gym.task.conditions import FIELD


def test_the_findings_are_the_measured_rates():
    rates = {name: 1000.0 + 100.0 * place for place, name in enumerate(RATES)}
    measured = {name: Figure(median=rate, low=rate, high=rate) for name, rate in rates.items()}
    said = " ".join(findings(measured))
    numbers = re.findall(r"\d[\d,]*\d(?= |:)", said)
    alone = rates["vector_env_steps_per_s"]
    for rate in (rates["env_steps_per_s"], rates["vector_env_policy_steps_per_s"]):
        assert f"{rate:,.0f}" in numbers
    assert f"{20 * alone:,.0f} physics steps" in said
    assert f"{rounded(alone * FIELD.control_period)} times real time" in said


def test_what_was_not_measured_is_not_said():
    assert findings({}) == []


def test_environments_are_timed_with_a_policy_and_without():
    timings = [
        environments.single_timing("alone", steps=3),
        environments.swimming_timing("with sta", "sta", steps=3),
        environments.vector_timing("many", size=2, steps=3),
        environments.swimming_vector_timing("many with sta", "sta", size=2, steps=3),
    ]
    assert [timing.units for timing in timings] == [3, 3, 6, 6]
    times = interleaved(timings, 2, lambda: None)
    assert all(time > 0.0 for rounds in times.values() for time in rounds)
