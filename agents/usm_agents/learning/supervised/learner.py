"""A recurrent network that corrects a law's estimates, fitted in rounds to what is true.

In every round the robots swim whole episodes under the law that acts on the corrected estimates,
and the network is fitted to the labels of this round and of the last ones. With the law's own
episodes alone it would not do: the corrections change what the law meets (dataset aggregation).

Source: S. Ross, G. Gordon, J. A. Bagnell, A reduction of imitation learning and structured
prediction to no-regret online learning, AISTATS 2011.
"""

from __future__ import annotations

import pickle
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3.common.logger import configure
from torch import nn
from torch.nn.functional import huber_loss
from usm_baselines.policy import Percept, ScriptedPolicy

from usm_agents.artifact.network import Network, Recurrence
from usm_agents.learning.divergence import check_weights
from usm_agents.learning.learner import TrainingSetup
from usm_agents.learning.supervised.labels import Labels
from usm_gym.support.seeding import TRAINING, stream

STATE = "estimator.pickle"
# From so many standard deviations on, a wrong correction costs linearly.
LINEAR = 3.0
LARGEST_GRADIENT = 1.0


class Round(NamedTuple):
    """What a round has collected.

    Attributes:
        seen: What the network observes, (periods, robots, numbers).
        wanted: The right corrections over the largest ones, (periods, robots, outputs).
        valid: Whether they count, 0 or 1, (periods, robots).
    """

    seen: NDArray[np.float32]
    wanted: NDArray[np.float32]
    valid: NDArray[np.float32]


def mean_ahead(
    values: NDArray[np.float64], valid: NDArray[np.float32], periods: int
) -> NDArray[np.float64]:
    """Mean of each value and those that follow it, so many in all, of which the valid ones count.

    Args:
        values: By period and robot, (periods, robots, axes).
        valid: Which of them count, 0 or 1, (periods, robots).
        periods: How many are averaged, less at the end.

    Returns:
        Means, (periods, robots, axes); 0 where none counts.
    """
    counted = valid[:, :, None].astype(np.float64)
    first = np.arange(len(values))
    last = np.minimum(first + periods, len(values))
    sums = []
    for part in (values * counted, counted):
        total = np.cumsum(np.concatenate([np.zeros_like(part[:1]), part]), axis=0)
        sums.append(total[last] - total[first])
    return np.asarray(sums[0] / np.maximum(sums[1], 1.0))


class Corrector(nn.Module):
    """A layer with memory, beside it what is seen now, a hidden layer, and corrections.

    The corrections are 0 at first. The memory takes in one observation in several, since what it is
    to keep does not change fast: so it is fitted faster, over more time, and learns less by heart.
    """

    def __init__(self, inputs: int, outputs: int, units: int, hidden: int, reach: int) -> None:
        """Make the layers; see `remember` for `reach`."""
        super().__init__()
        self.memory = nn.LSTM(inputs, units)
        remember(self.memory, reach)
        self.hidden, self.last = nn.Linear(units + inputs, hidden), nn.Linear(hidden, outputs)
        nn.init.zeros_(self.last.weight)
        nn.init.zeros_(self.last.bias)

    def forward(  # type: ignore[no-untyped-def]
        self, taken: torch.Tensor, seen: torch.Tensor, kept: tuple[torch.Tensor, ...] | None
    ):
        """Corrections, (instants, robots, outputs), and what is kept.

        Args:
            taken: What the memory takes in, (instants, robots, inputs).
            seen: What is seen a while later, the same number of instants.
            kept: What the last call returned; None at the start.
        """
        answers, kept = self.memory(taken, kept)
        return self.last(torch.tanh(self.hidden(torch.cat([answers, seen], dim=2)))), kept


def remember(memory: nn.LSTM, reach: int) -> None:
    """Let the units of a memory keep what they take in for 1 to `reach` instants at first.

    Source: C. Tallec, Y. Ollivier, Can recurrent neural networks warp time?, ICLR 2018.
    """
    units = memory.hidden_size
    kept = torch.log(1.0 + (reach - 1.0) * torch.rand(units))
    _, _, bias, other = memory.parameters()
    with torch.no_grad():
        bias.zero_()
        other.zero_()
        bias[:units], bias[units : 2 * units] = -kept, kept


class EstimatorLearner:
    """Learns to correct the estimates that a law acts on; a `Learner` for the action "estimates".

    Settings: robots; control periods over which the label of the disturbance is averaged; rounds
    whose data are kept; epochs of a fit; robots of a batch; control periods from one observation
    that the memory takes in to the next, and through how many of these gradients go; learning rate;
    weight decay; units of the memory, for how many of the observations that it takes in they
    remember at first, and the width of the hidden layer.
    """

    def __init__(self, setup: TrainingSetup) -> None:
        """Make a network that corrects nothing yet, for an agent whose action is "estimates"."""
        torch.set_num_threads(1)
        torch.manual_seed(setup.seed)
        self._setup, self._residual = setup, setup.envs.residual
        base, settings = self._residual.base, setup.settings
        assert isinstance(base, ScriptedPolicy)
        self._labels = Labels(base)
        self._model = Corrector(
            self._residual.layout.size,
            self._residual.actions,
            settings["units"],
            settings["hidden"],
            settings["reach"],
        )
        self._optimizer = torch.optim.AdamW(
            self._model.parameters(),
            settings["learning_rate"],
            weight_decay=settings["weight_decay"],
        )
        self._random = stream(setup.seed, TRAINING)
        self._rounds: list[Round] = []
        # Standard deviations of what is wanted at first, by output.
        self._unit: NDArray[np.float32] | None = None
        self._loss = float("nan")
        self.steps = 0

    def learn(self, steps: int, pause: Callable[[], None]) -> None:
        """Collect and fit, round by round; see `Learner`."""
        self._logger = configure(str(self._setup.folder), ["tensorboard"])
        while self.steps < steps:
            pause()
            self._rounds = [*self._rounds, self._collect()][-self._setup.settings["kept"] :]
            self.steps += self._rounds[-1].valid.size
            self._fit(done=min(self.steps / steps, 1.0))
            check_weights(weight.detach().numpy() for weight in self._model.parameters())

    def _collect(self) -> Round:
        """Let the robots swim, each an episode from its beginning."""
        setup, envs, residual, labels = self._setup, self._setup.envs, self._residual, self._labels
        network, robots = self.export(), envs.num_envs
        episodes = [setup.draw(self._random) for _ in range(robots)]
        length = min(episode.duration for episode in episodes)
        periods = round(length / residual.nominal.control_period)
        seen, _ = envs.reset(seed=int(self._random.integers(2**31)), options={"scenario": episodes})
        velocity = residual.layout.slices["reference_velocity"]
        scale = residual.layout.scale[velocity]
        inputs = np.empty((periods, *seen.shape), np.float32)
        wanted = np.zeros((periods, robots, len(scale), len(residual.correction)))
        missed = np.zeros((periods, robots, len(scale)))
        valid = np.zeros((periods, robots), np.float32)
        kept, start = None, np.ones(robots, bool)
        first_episode = np.ones(robots, bool)
        for k in range(periods):
            known, truth = envs.memory.known, setup.truth()
            assert isinstance(known, Percept)  # the task is to correct estimates
            observation = known.signals.observation
            rate = truth["velocity"] - scale * seen[:, velocity]
            if k > 0:
                missed[k - 1] = labels.missed(observation, rate)
            inputs[k], wanted[k] = seen, labels.take(known.state, truth["error"], rate)
            action, kept = network.predict(seen, kept, start)
            seen, _, terminated, truncated, _ = envs.step(action)
            start = terminated | truncated
            first_episode &= ~start
            valid[k] = first_episode
        valid[-1] = 0.0  # how the disturbance of the last period goes on is not known
        wanted[:, :, :, 2] += mean_ahead(missed, valid, setup.settings["horizon"])
        wanted /= residual.correction
        return Round(inputs, wanted.reshape(periods, robots, -1).astype(np.float32), valid)

    def _fit(self, done: float) -> None:
        """Fit the network to the rounds; the learning rate falls to a tenth as all is done."""
        settings = self._setup.settings
        if self._unit is None:
            first = self._rounds[0]
            self._unit = np.sqrt(np.mean(first.wanted[first.valid > 0.0] ** 2, axis=0)) + 1e-6
        for group in self._optimizer.param_groups:
            group["lr"] = settings["learning_rate"] * (1.0 - 0.9 * done)
        unit = torch.from_numpy(self._unit)
        seen, wanted, valid = (
            torch.from_numpy(np.concatenate(parts, axis=1))
            for parts in zip(*self._rounds, strict=True)
        )
        period = settings["memory_period"]
        span, instants = settings["window"] * period, len(seen) // period
        losses: list[float] = []
        for _ in range(settings["epochs"]):
            order = torch.from_numpy(self._random.permutation(seen.shape[1]))
            for robots in order.split(settings["batch"]):
                its = [part[: instants * period, robots] for part in (seen, wanted, valid)]
                kept = None
                for begin in range(0, instants * period, span):
                    taken = slice(begin, begin + span, period)
                    # What is wanted at one of the periods until the memory is next refreshed.
                    now = slice(begin + int(self._random.integers(period)), begin + span, period)
                    answer, kept = self._model(its[0][taken], its[0][now], kept)
                    kept = tuple(each.detach() for each in kept)
                    counted = its[2][now, :, None].expand_as(answer)
                    off, none = (answer - its[1][now]) / unit, torch.zeros_like(answer)
                    costs = counted * huber_loss(off, none, reduction="none", delta=LINEAR)
                    loss = costs.sum() / (counted.sum() + 1.0)
                    self._optimizer.zero_grad()
                    loss.backward()
                    nn.utils.clip_grad_norm_(self._model.parameters(), LARGEST_GRADIENT)
                    self._optimizer.step()
                    losses.append(loss.item())
        self._loss = float(np.mean(losses))

    def export(self) -> Network:
        """Copy the network."""
        model = self._model
        given, kept, one, other = (weight.detach().numpy() for weight in model.memory.parameters())
        layers = (model.hidden, model.last)
        return Network(
            tuple(layer.weight.detach().numpy().T.copy() for layer in layers),
            tuple(layer.bias.detach().numpy().copy() for layer in layers),
            "tanh",
            "clip",
            Recurrence(
                given.T.copy(),
                kept.T.copy(),
                one + other,
                self._setup.settings["memory_period"],
            ),
        )

    def log(self, numbers: Mapping[str, float]) -> None:
        """Write numbers to the log for TensorBoard, with the loss of the last fit."""
        for name, number in {**numbers, "train/loss": self._loss}.items():
            self._logger.record(name, number)
        self._logger.dump(self.steps)

    def save(self, checkpoint: Path) -> None:
        """Write network, optimizer, rounds and random state, as a pickle."""
        weights = self._model.state_dict(), self._optimizer.state_dict()
        state = self.steps, weights, self._rounds, self._unit, self._random, self._loss
        (checkpoint / STATE).write_bytes(pickle.dumps(state))

    def restore(self, checkpoint: Path) -> None:
        """Go back to what `save` wrote, which is code and is run."""
        state = pickle.loads((checkpoint / STATE).read_bytes())
        self.steps, (model, optimizer), *rest = state
        self._rounds, self._unit, self._random, self._loss = rest
        self._model.load_state_dict(model)
        self._optimizer.load_state_dict(optimizer)
