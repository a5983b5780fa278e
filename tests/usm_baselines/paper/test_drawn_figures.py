"""What the figures of the reproduction draw."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from usm_baselines.paper.reproduction_figures import INTERVALS, thinned


@given(st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=5 * INTERVALS))
def test_a_thinned_signal_keeps_its_ends_its_extremes_and_its_order(values):
    signal = np.array(values)
    time = np.arange(len(signal), dtype=float)
    times, kept = thinned(time, signal)
    assert (np.diff(times) > 0).all()
    assert len(times) <= 2 * INTERVALS + 2
    assert (kept == signal[times.astype(int)]).all()
    assert (kept.min(), kept.max()) == (signal.min(), signal.max())
    assert (times[0], times[-1]) == (time[0], time[-1])
