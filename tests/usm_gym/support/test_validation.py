from pathlib import Path

import numpy as np
import pytest

from usm_gym.support.validation import QUOTED, SAID, brief, clipped, in_one_line, require
from usm_gym.task.conditions import Conditions


class Unprintable:
    def __repr__(self):
        raise RuntimeError


@pytest.mark.parametrize(
    "value",
    [
        "a" * 10**7,
        10**5000,
        np.zeros((300, 300)),
        [[[[[0]]]]] * 99,
        {"a": "\n" * 99},
        Unprintable(),
    ],
    ids=["text", "integer", "array", "list", "dict", "unprintable"],
)
def test_a_value_is_quoted_on_one_line_of_bounded_length(value):
    text = brief(value)
    assert 0 < len(text) <= QUOTED
    assert "\n" not in text


def test_short_texts_stay_as_they_are_and_long_ones_keep_their_ends():
    assert clipped("position_noise  is\n-1") == "position_noise is -1"
    short = clipped("begin " + 10**6 * "middle " + "end")
    assert len(short) <= QUOTED
    assert short.startswith("begin")
    assert short.endswith("end")


@pytest.mark.parametrize(
    "wrong",
    [
        {"physics_step": "x" * 10**6},
        {"x" * 10**6: 1},
        {f"field {i}": i for i in range(1000)},
    ],
    ids=["value", "name", "many"],
)
def test_an_error_is_short_whatever_it_is_about(wrong):
    with pytest.raises(ValueError, match=": ") as caught:
        Conditions(**wrong)
    assert len(str(caught.value)) <= SAID
    assert "\n" not in str(caught.value)
    with pytest.raises(ValueError, match="allowed: none") as caught:
        require(False, "n" * 10**6, wrong, "none")
    assert len(str(caught.value)) <= SAID


def test_the_name_of_a_file_is_shortened():
    with pytest.raises(OSError, match="too long") as caught:
        Path("/" + "b" * 10**6).read_bytes()
    assert len(in_one_line(caught.value)) <= SAID
