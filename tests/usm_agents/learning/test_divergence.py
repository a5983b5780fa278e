"""Signs that a training has diverged."""

import numpy as np
import pytest
from usm_agents.learning.divergence import DivergedError, check_curve, check_weights


@pytest.mark.parametrize("weight", [2e6, -2e6, np.inf, np.nan])
def test_weights_beyond_all_bounds_are_refused(weight):
    check_weights([np.zeros(3), np.full((2, 2), 1e5)])
    with pytest.raises(DivergedError, match="a weight"):
        check_weights([np.zeros(3), np.array([[0.0, weight]])])


def curve(*errors):
    return [
        {"max_error_x": error, "max_error_y": error, "thrust_variation": 0.0} for error in errors
    ]


@pytest.mark.parametrize(
    "errors", [(9,), (9, 9), (1, 9, 9), (1, 9, 9, 2), (9, 1, 9, 9), (1, 5, 5, 5)]
)
def test_a_few_bad_validations_are_none_of_it(errors):
    check_curve(curve(*errors))


@pytest.mark.parametrize("errors", [(1, 6, 6, 6), (9, 1, 6, 7, 8)])
def test_three_bad_validations_in_a_row_are(errors):
    with pytest.raises(DivergedError, match="5 times the best"):
        check_curve(curve(*errors))
