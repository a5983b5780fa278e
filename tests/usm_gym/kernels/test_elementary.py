"""The elementary functions are right to the last bit or nearly, and the same however evaluated."""

import math
from collections.abc import Callable
from typing import Any

import mpmath
import numba
import numpy as np
import pytest
from numpy.typing import NDArray

from usm_gym.kernels import elementary
from usm_gym.kernels.elementary import arctan, cube_root, exp_of_negative, sincos
from usm_gym.kernels.lanes import WIDTH, block_at, load, spread, store

Array = NDArray[np.float64]

PRECISION = 200  # bits: 53 of the answer, 17 of the angle, 60 lost near multiples of pi, to spare


@numba.njit
def sines(x: Array, s: Array, c: Array) -> None:
    for i in range(x.size):
        s[i], c[i] = sincos(x[i])


@numba.njit
def sines_in_lanes(blocks: Array) -> None:
    like = spread(0.0)
    for k in range(blocks.shape[0]):
        block = block_at(blocks, k, like)
        s, c = sincos(load(block, 0, like))
        store(block, 1, s)
        store(block, 2, c)


@numba.njit
def square_roots_in_lanes(blocks: Array) -> None:
    like = spread(0.0)
    for k in range(blocks.shape[0]):
        block = block_at(blocks, k, like)
        store(block, 1, math.sqrt(load(block, 0, like)))


@numba.njit
def exponentials(x: Array, y: Array) -> None:
    for i in range(x.size):
        y[i] = exp_of_negative(x[i])


@numba.njit
def cube_roots(x: Array, y: Array) -> None:
    for i in range(x.size):
        y[i] = cube_root(x[i])


@numba.njit
def arc_tangents(x: Array, y: Array) -> None:
    for i in range(x.size):
        y[i] = arctan(x[i])


def each(kernel: Any, x: Array) -> Array:
    """Return a kernel's value at every x."""
    y = np.empty_like(x)
    kernel(x, y)
    return y


def sine_and_cosine(x: Array) -> tuple[Array, Array]:
    s, c = np.empty_like(x), np.empty_like(x)
    sines(x, s, c)
    return s, c


def worst_error(x: Array, values: Array, exact: Callable[[Any], Any]) -> float:
    """Return the largest error in units of the last place of the exact value."""
    with mpmath.workprec(PRECISION):
        errors = []
        for at, value in zip(x.tolist(), values.tolist(), strict=True):
            true = exact(mpmath.mpf(at))
            errors.append(float(abs(mpmath.mpf(value) - true) / np.spacing(abs(float(true)))))
    return max(errors)


def magnitudes(low: float, high: float, count: int, seed: int) -> Array:
    """Return numbers whose logarithms are uniform between those of low and high."""
    return np.exp(np.random.default_rng(seed).uniform(np.log(low), np.log(high), count))


def angles() -> Array:
    """Return angles of every size, and those where the reduction cancels most."""
    rng = np.random.default_rng(0)
    small = magnitudes(1e-12, 1e5, 2000, 1) * rng.choice([-1.0, 1.0], 2000)
    quarters = rng.integers(-63000, 63000, 1000) * (np.pi / 2)
    eighths = rng.integers(-63000, 63000, 500) * (np.pi / 4)
    near = np.nextafter(quarters, rng.choice([-np.inf, np.inf], 1000))
    return np.concatenate([rng.uniform(-1e5, 1e5, 2000), small, quarters, near, eighths, [0.0]])


def roots() -> Array:
    return magnitudes(1e-290, 1e290, 4000, 2)


def decays() -> Array:
    rng = np.random.default_rng(3)
    return np.concatenate([rng.uniform(-700.0, 0.0, 2000), -magnitudes(1e-12, 700.0, 2000, 4)])


def slopes() -> Array:
    rng = np.random.default_rng(5)
    sizes = [magnitudes(1e-12, 1e12, 2000, 6), magnitudes(0.1, 10.0, 2000, 7)]
    return np.concatenate(sizes) * rng.choice([-1.0, 1.0], 4000)


def test_sine_and_cosine_are_within_one_unit_in_the_last_place() -> None:
    x = angles()
    s, c = sine_and_cosine(x)
    assert worst_error(x, s, mpmath.sin) <= 1.0
    assert worst_error(x, c, mpmath.cos) <= 1.0


@pytest.mark.parametrize(
    ("kernel", "exact", "x"),
    [
        pytest.param(exponentials, mpmath.exp, decays(), id="exp"),
        pytest.param(cube_roots, mpmath.cbrt, roots(), id="cube root"),
        pytest.param(arc_tangents, mpmath.atan, slopes(), id="arctan"),
    ],
)
def test_the_others_are_within_one_unit_in_the_last_place(
    kernel: Any, exact: Callable[[Any], Any], x: Array
) -> None:
    assert worst_error(x, each(kernel, x), exact) <= 1.0


def test_ends_of_the_ranges() -> None:
    s, c = sine_and_cosine(np.zeros(1))
    assert (s[0], c[0]) == (0.0, 1.0)
    assert each(exponentials, np.array([0.0]))[0] == 1.0
    floor, below = each(exponentials, np.array([-700.0, -1e9]))
    assert floor == below
    assert 0.0 < floor < 1e-303
    assert each(cube_roots, np.array([0.0, 1.0, 27.0])).tolist() == [0.0, 1.0, 3.0]
    assert each(arc_tangents, np.array([0.0, 1e300])).tolist() == [0.0, np.pi / 2]


def test_lanes_have_the_bits_of_single_numbers() -> None:
    x = angles()
    x = x[: x.size // WIDTH * WIDTH].reshape(-1, WIDTH)
    blocks = np.zeros((len(x), 3, WIDTH))
    blocks[:, 0] = x
    sines_in_lanes(blocks.reshape(len(x), -1))
    s, c = sine_and_cosine(x.ravel())
    assert np.array_equal(blocks[:, 1].ravel(), s)
    assert np.array_equal(blocks[:, 2].ravel(), c)


def test_square_roots_in_lanes_are_rounded_as_ieee_754_has_it() -> None:
    x = magnitudes(5e-324, 1e308, 80 * WIDTH, 8).reshape(-1, WIDTH)
    x[0, 0], x[0, 1], x[1] = 0.0, 5e-324, np.nextafter(1.0, 0.0)
    blocks = np.zeros((len(x), 2, WIDTH))
    blocks[:, 0] = x
    square_roots_in_lanes(blocks.reshape(len(x), -1))
    assert np.array_equal(blocks[:, 1], np.sqrt(x))


def test_machine_code_has_the_bits_of_plain_python(monkeypatch: pytest.MonkeyPatch) -> None:
    # Plain Python neither contracts nor reorders; so nor must the compiler.
    x = angles()[::5]
    s, c = sine_and_cosine(x)
    monkeypatch.setattr(elementary, "where", lambda mask, yes, no: yes if mask else no)
    assert [sincos.py_func(float(at)) for at in x] == list(zip(s, c, strict=True))
    for kernel, function, numbers in (
        (exponentials, exp_of_negative, decays()[::5]),
        (cube_roots, cube_root, roots()[::5]),
        (arc_tangents, arctan, slopes()[::5]),
    ):
        assert [function.py_func(float(at)) for at in numbers] == each(kernel, numbers).tolist()
