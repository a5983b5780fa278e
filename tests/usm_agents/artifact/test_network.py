"""The network of an agent: with memory it is what torch makes of the same weights."""

from itertools import pairwise

import numpy as np
import pytest
from usm_agents.artifact.network import Network, Recurrence

torch = pytest.importorskip("torch")

PERIOD, INPUTS, UNITS, HIDDEN, OUTPUTS = 5, 7, 4, 6, 3


def layers(beside):
    """Layers of torch: memory, hidden layer, the last one; and the network of their weights."""
    torch.manual_seed(0)
    memory = torch.nn.LSTM(INPUTS, UNITS)
    hidden = torch.nn.Linear(UNITS + (INPUTS if beside else 0), HIDDEN)
    last = torch.nn.Linear(HIDDEN, OUTPUTS)
    given, kept, *biases = (each.detach().numpy() for each in memory.parameters())
    network = Network(
        tuple(layer.weight.detach().numpy().T.copy() for layer in (hidden, last)),
        tuple(layer.bias.detach().numpy().copy() for layer in (hidden, last)),
        "tanh",
        "clip",
        Recurrence(given.T.copy(), kept.T.copy(), sum(biases), PERIOD),
    )
    return memory, hidden, last, network


@pytest.mark.parametrize("beside", [True, False])
def test_a_memory_takes_in_one_observation_in_several_and_its_answer_stays(beside):
    memory, hidden, last, network = layers(beside)
    random = np.random.default_rng(0)
    seen = random.normal(size=(60, 4, INPUTS)).astype(np.float32)
    starts = random.random((60, 4)) < 0.05
    starts[0] = True
    state, singles, found = None, [None] * 4, []
    for now, start in zip(seen, starts, strict=True):
        answer, state = network.predict(now, state, start)
        for b in range(4):
            alone, singles[b] = network.predict(now[b : b + 1], singles[b], start[b : b + 1])
            assert alone.tobytes() == answer[b].tobytes()
        found.append(answer)
    lengths = set()
    for b in range(4):
        begins = [*np.flatnonzero(starts[:, b]), 60]
        for begin, end in pairwise(begins):
            episode = torch.from_numpy(seen[begin:end, b].copy())
            with torch.no_grad():
                answers = memory(episode[::PERIOD])[0]
                above = answers.repeat_interleave(PERIOD, dim=0)[: end - begin]
                if beside:
                    above = torch.cat([above, episode], dim=1)
                expected = last(torch.tanh(hidden(above))).clip(-1.0, 1.0).numpy()
            np.testing.assert_allclose(np.array(found)[begin:end, b], expected, atol=1e-6)
            lengths.add((end - begin) % PERIOD)
    assert len(lengths) > 2


@pytest.mark.parametrize("width", [UNITS - 1, UNITS + 1, UNITS + INPUTS + 1])
def test_a_layer_above_sees_the_memory_or_all_beside_it(width):
    *_, network = layers(False)
    weights = (np.zeros((width, HIDDEN), np.float32), network.weights[1])
    with pytest.raises(ValueError, match="shapes of a layer"):
        Network(weights, network.biases, "tanh", "clip", network.recurrence)
