"""Model predictive control: the forced response is the model's, the first change the best one's."""

import numpy as np
import pytest
from usm_baselines.estimation import kalman
from usm_baselines.laws.mpc import forced_response, receding_gain


def test_the_forced_response_is_the_model_stepped() -> None:
    T = kalman.sampled(0.4, 0.05, 0.02)
    changes = np.random.default_rng(0).normal(size=6)
    x, u, errors = np.zeros(4), 0.0, []
    for change in changes:
        u += change
        x = T @ [*x, u, 0.0]
        errors.append(x[0])
    np.testing.assert_allclose(forced_response(T, 6) @ changes, errors, rtol=1e-12)


def test_the_first_change_is_that_of_the_least_squares() -> None:
    T = kalman.sampled(0.4, 0.05, 0.02)
    free, weight = np.random.default_rng(1).normal(size=8), 1e-3
    S = np.vstack([forced_response(T, 8), weight * np.eye(8)])
    best, *_ = np.linalg.lstsq(S, np.append(-free, np.zeros(8)), rcond=None)
    assert -receding_gain(T, 8, weight) @ free == pytest.approx(best[0], rel=1e-6)
