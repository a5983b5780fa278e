"""Scripted policies for the environments of `usm_gym`."""

from usm_baselines.registry import ids, make, register

__all__ = ["ids", "make", "register"]
