"""Scripted policies for the environments of `usm_gym`."""

from baselines.registry import ids, make, register

__all__ = ["ids", "make", "register"]
