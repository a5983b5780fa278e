"""Trainings whose validations and tests are soon over."""

from dataclasses import replace

from usm_agents.learning import validation
from usm_agents.learning.plan import Plan


def brief(scenario):
    """The first two seconds of a scenario."""
    return replace(scenario, duration=2.0, settle_time=0.5)


def shorten(monkeypatch):
    """Let agents be trained, validated and tested on the first two seconds of scenarios."""
    sampled, unseen = Plan.scenario, validation.unseen
    monkeypatch.setattr(Plan, "scenario", lambda *given: brief(sampled(*given)))
    monkeypatch.setattr(validation, "unseen", lambda *given: [*map(brief, unseen(*given))])
