"""The network of a trained agent, without torch: the same bits for any batch and on any machine."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from usm_gym.kernels.compile import compiled, piece
from usm_gym.kernels.elementary import exp_of_negative
from usm_gym.support.validation import require

Array = NDArray[np.float32]
Activation = Literal["tanh", "relu"]
# What becomes of the last layer: cut off at +-1 (PPO), or squashed (SAC, TD3, TQC).
Output = Literal["clip", "tanh"]

TANH, RELU, CLIP = range(3)
CODES = {"tanh": TANH, "relu": RELU, "clip": CLIP}


class Recurrence(NamedTuple):
    """A layer of long short-term memory; its four gates are in torch's order: i, f, g, o.

    Where the first layer above it is wide enough, that sees the observation, too.

    Attributes:
        given: Weights of what is given, (inputs, 4 units), float32.
        kept: Weights of its own last answer, (units, 4 units), float32.
        bias: (4 units,), float32.
        period: It takes in an observation at the first call of an episode and then at every call
            after so many; in between its answer stays.
    """

    given: Array
    kept: Array
    bias: Array
    period: int = 1

    @property
    def units(self) -> int:
        """How many numbers it answers with."""
        return int(self.kept.shape[0])


@dataclass(frozen=True)
class Network:
    """Fully connected layers from an observation to an action; a policy, as `predict` goes.

    Attributes:
        weights: Per layer, (inputs, outputs), float32.
        biases: Per layer, (outputs,), float32.
        activation: Of the hidden layers.
        output: Of the last one.
        recurrence: A layer with memory before them, if there is one.
    """

    weights: tuple[Array, ...]
    biases: tuple[Array, ...]
    activation: Activation
    output: Output
    recurrence: Recurrence | None = None

    def __post_init__(self) -> None:
        """Refuse layers that do not fit one another."""
        require(len(self.weights) == len(self.biases) > 0, "layers", len(self.weights), "1 or more")
        width = self.inputs
        if self.recurrence is not None:
            given, kept, bias, period = self.recurrence
            require(period >= 1, "period of the recurrence", period, "1 or more")
            gates = 4 * len(kept)
            require(bias.shape == (gates,), "gates of the recurrence", bias.shape, f"({gates},)")
            check_layer(given, bias, width)
            width = self.recurrence.units
            check_layer(kept, bias, width)
            if self.weights[0].ndim == 2 and len(self.weights[0]) != width:
                width += self.inputs
        for weight, bias in zip(self.weights, self.biases, strict=True):
            check_layer(weight, bias, width)
            width = weight.shape[1]

    @property
    def inputs(self) -> int:
        """How many numbers it takes in."""
        first = self.weights[0] if self.recurrence is None else self.recurrence.given
        return int(first.shape[0])

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
        """Act on a batch of observations, (batch, inputs), always deterministically.

        Args:
            observation: Observations, (batch, inputs).
            state: What the last call returned; None at the start.
            episode_start: Where an episode starts, (batch,).
            deterministic: Whatever is asked for.

        Returns:
            Actions, (batch, outputs), and the state: nothing, or what a recurrence has answered and
            keeps, and how many calls ago it took in anything, (batch, 2 units + 1).
        """
        values = np.asarray(observation, np.float32)
        if self.recurrence is not None:
            units = self.recurrence.units
            if state is None:
                state = np.zeros((len(values), 2 * units + 1), np.float32)
            start = np.zeros(len(values), bool) if episode_start is None else episode_start
            state = np.where(np.asarray(start)[:, None], np.float32(0.0), state)
            recur(*self.recurrence, values, state)
            beside = len(self.weights[0]) > units
            parts = [state[:, :units], values] if beside else [state[:, :units]]
            values = np.concatenate(parts, axis=1)
        last = len(self.weights) - 1
        for k, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            out = np.empty((len(values), bias.size), np.float32)
            layer(weight, bias, values, CODES[self.output if k == last else self.activation], out)
            values = out
        return values, state


def check_layer(weight: Array, bias: Array, width: int) -> None:
    """Refuse a layer that does not take in so many numbers, or has others than finite ones."""
    shapes = (weight.shape, bias.shape)
    fits = weight.ndim == 2 and weight.shape[0] == width and bias.shape == weight.shape[1:]
    require(fits, "shapes of a layer", shapes, f"({width}, outputs) and (outputs,)")
    require(weight.dtype == bias.dtype == np.float32, "type of a layer", weight.dtype, "float32")
    finite = np.isfinite(weight).all() and np.isfinite(bias).all()
    require(finite, "numbers of a layer", "not finite", "finite ones")


@piece
def tanh(x: float) -> float:
    """Hyperbolic tangent."""
    e = exp_of_negative(-2.0 * abs(x))
    size = (1.0 - e) / (1.0 + e)
    return size if x > 0.0 else -size


@piece
def sigmoid(x: float) -> float:
    """Logistic function."""
    e = exp_of_negative(-abs(x))
    return (1.0 if x > 0.0 else e) / (1.0 + e)


@piece
def add_product(weight, values, row):  # type: ignore[no-untyped-def]
    """Add the product of values and weights to a row; the order of additions is always the same."""
    for i in range(weight.shape[0]):
        value = values[i]
        for j in range(row.size):
            row[j] += value * weight[i, j]


@compiled
def layer(weight, bias, values, function, out):  # type: ignore[no-untyped-def]
    """Fill in a layer's answer for a batch."""
    for b in range(out.shape[0]):
        row = out[b]
        row[:] = bias
        add_product(weight, values[b], row)
        for j in range(row.size):
            if function == TANH:
                row[j] = tanh(np.float64(row[j]))
            elif function == RELU:
                row[j] = max(row[j], np.float32(0.0))
            else:
                row[j] = min(max(row[j], np.float32(-1.0)), np.float32(1.0))


@compiled
def recur(given, kept, bias, period, values, state):  # type: ignore[no-untyped-def]
    """Advance a recurrence by the observations of a batch; `state` is (batch, 2 units + 1)."""
    units = kept.shape[0]
    gates = np.empty(4 * units, np.float32)
    for b in range(len(values)):
        calls = state[b, 2 * units]
        state[b, 2 * units] = (calls + 1) % period
        if calls > 0:
            continue
        answer, memory = state[b, :units], state[b, units : 2 * units]
        gates[:] = bias
        add_product(given, values[b], gates)
        add_product(kept, answer, gates)
        for j in range(units):
            new = sigmoid(np.float64(gates[j])) * tanh(np.float64(gates[2 * units + j]))
            memory[j] = sigmoid(np.float64(gates[units + j])) * memory[j] + new
            answer[j] = sigmoid(np.float64(gates[3 * units + j])) * tanh(np.float64(memory[j]))
