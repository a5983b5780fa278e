"""Streams of random numbers, one per purpose, which never overlap."""

from __future__ import annotations

import numpy as np

SUITE, EVALUATION, TRAINING, TUNING, VALIDATION, RECORDING = range(6)


def stream(seed: int, purpose: int, *index: int) -> np.random.Generator:
    """Give the stream of a purpose, or of one of its episodes, under a seed."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(purpose, *index)))
