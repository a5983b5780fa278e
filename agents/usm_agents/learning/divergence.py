"""Signs that a training has diverged."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from usm_agents.learning.validation import Validation
from usm_gym.support.validation import UsageError
from usm_gym.task.metrics import objective

# So many validations in a row are so many times worse than the best.
COLLAPSE_COUNT, COLLAPSE_RATIO = 3, 5.0
# A weight is larger than this.
LARGEST_WEIGHT = 1e6


class DivergedError(UsageError):
    """A training that has diverged."""


def check_weights(weights: Iterable[NDArray[np.floating]]) -> None:
    """Refuse weights that have grown out of all bounds, or are no longer numbers.

    Raises:
        DivergedError: If one has.
    """
    if not all(np.all(np.abs(weight) < LARGEST_WEIGHT) for weight in weights):
        raise DivergedError(f"a weight is beyond {LARGEST_WEIGHT:g}")


def check_curve(curve: Sequence[Validation]) -> None:
    """Refuse a learning curve whose last validations are all far worse than the best.

    Raises:
        DivergedError: If they are.
    """
    errors = [objective(validation) for validation in curve]
    limit = COLLAPSE_RATIO * min(errors)
    last = errors[-COLLAPSE_COUNT:]
    if len(last) == COLLAPSE_COUNT and all(error > limit for error in last):
        raise DivergedError(f"the error is {COLLAPSE_RATIO:g} times the best and more")
