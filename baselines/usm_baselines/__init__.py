"""Scripted policies for the environments of `usm_gym`."""

import usm_baselines.policies  # noqa: F401 (registers them)
from usm_baselines.registry import ids, make, register

__all__ = ["ids", "make", "register"]
