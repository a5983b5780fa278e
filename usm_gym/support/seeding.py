"""Streams of random numbers: one for each purpose, so that none ever meets another."""

from __future__ import annotations

import numpy as np

SUITE, EVALUATION, TRAINING, TUNING, VALIDATION = range(5)


def stream(seed: int, purpose: int, *index: int) -> np.random.Generator:
    """The stream of a purpose, and of an episode of it, under a seed."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(purpose, *index)))
