"""What a law works with, made up."""

import numpy as np
from usm_baselines.signals import Signals


def made_signals(started, y, u, velocity, acceleration, **rest) -> Signals:
    """Signals of a batch without a navigator, whose positions have just been measured."""
    nothing = np.zeros_like(y)
    size, axes = y.shape
    chosen = {
        "allocation": np.zeros((size, axes + 1, 5)),
        "observation": np.zeros((size, 94), np.float32),
    } | rest
    return Signals(
        started=started,
        fresh=np.ones(size, np.bool_),
        navigated=False,
        y=y,
        rate=nothing,
        disturbance=nothing,
        thrust=nothing,
        u=u,
        velocity=velocity,
        acceleration=acceleration,
        **chosen,
    )
