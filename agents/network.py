"""The network of a trained agent, without torch: the same bits for any batch and on any machine."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from usm_gym.plant.compile import compiled, piece
from usm_gym.plant.elementary import exp_of_negative
from usm_gym.validation import require

Array = NDArray[np.float32]
Activation = Literal["tanh", "relu"]
# What becomes of the last layer: cut off at +-1 (PPO), or squashed (SAC, TD3, TQC).
Output = Literal["clip", "tanh"]

TANH, RELU, CLIP = range(3)
CODES = {"tanh": TANH, "relu": RELU, "clip": CLIP}


@dataclass(frozen=True)
class Network:
    """Fully connected layers from an observation to an action; a policy, as `predict` goes.

    Attributes:
        weights: Of each layer, (inputs, outputs), float32.
        biases: Of each layer, (outputs,), float32.
        activation: Of the hidden layers.
        output: Of the last one.
    """

    weights: tuple[Array, ...]
    biases: tuple[Array, ...]
    activation: Activation
    output: Output

    def __post_init__(self) -> None:
        """Refuse layers that do not fit one another."""
        require(len(self.weights) == len(self.biases) > 0, "layers", len(self.weights), "1 or more")
        width = self.inputs
        for weight, bias in zip(self.weights, self.biases, strict=True):
            shapes = (weight.shape, bias.shape)
            fits = weight.ndim == 2 and weight.shape[0] == width and bias.shape == weight.shape[1:]
            require(fits, "shapes of a layer", shapes, f"({width}, outputs) and (outputs,)")
            require(
                weight.dtype == bias.dtype == np.float32, "type of a layer", weight.dtype, "float32"
            )
            finite = np.isfinite(weight).all() and np.isfinite(bias).all()
            require(finite, "numbers of a layer", "not finite", "finite ones")
            width = weight.shape[1]

    @property
    def inputs(self) -> int:
        """How many numbers it takes in."""
        return int(self.weights[0].shape[0])

    @property
    def outputs(self) -> int:
        """How many numbers it gives."""
        return int(self.biases[-1].size)

    def predict(
        self,
        observation: Array,
        state: Any = None,
        episode_start: Any = None,
        deterministic: bool = True,
    ) -> tuple[Array, Any]:
        """Act on a batch of observations, (batch, inputs); always deterministic, without state."""
        values = np.asarray(observation, np.float32)
        last = len(self.weights) - 1
        for k, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            out = np.empty((len(values), bias.size), np.float32)
            layer(weight, bias, values, CODES[self.output if k == last else self.activation], out)
            values = out
        return values, state


@piece
def tanh(x: float) -> float:
    """Hyperbolic tangent."""
    e = exp_of_negative(-2.0 * abs(x))
    size = (1.0 - e) / (1.0 + e)
    return size if x > 0.0 else -size


@compiled
def layer(weight, bias, values, function, out):  # type: ignore[no-untyped-def]
    """Fill in a layer's answer for a batch; the order of additions is always the same."""
    for b in range(out.shape[0]):
        row = out[b]
        row[:] = bias
        for i in range(weight.shape[0]):
            value = values[b, i]
            for j in range(row.size):
                row[j] += value * weight[i, j]
        for j in range(row.size):
            if function == TANH:
                row[j] = tanh(np.float64(row[j]))
            elif function == RELU:
                row[j] = max(row[j], np.float32(0.0))
            else:
                row[j] = min(max(row[j], np.float32(-1.0)), np.float32(1.0))
