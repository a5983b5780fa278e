"""What acts: the one thing that evaluation asks of a policy."""

from __future__ import annotations

from typing import Any, Protocol


class Policy(Protocol):
    """Anything that acts: Stable-Baselines3's `predict`, for one observation or a batch."""

    def predict(
        self,
        observation: Any,
        state: Any = None,
        episode_start: Any = None,
        deterministic: bool = True,
    ) -> tuple[Any, Any]:
        """Return the action, and the state to pass to the next call."""
        ...
