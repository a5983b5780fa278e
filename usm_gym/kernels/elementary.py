"""Elementary functions with the same bits on every machine.

A machine's mathematical library may answer differently from the next one's in the last bit, and a
vectorised loop differently from a scalar one. These functions use only additions, multiplications
and divisions, which IEEE 754 fixes. Each is within one unit in the last place of the exact value
(`tests/usm_gym/kernels/test_elementary.py`).
"""

from __future__ import annotations

import numpy as np

from usm_gym.kernels.compile import piece
from usm_gym.kernels.lanes import where

# Adding and subtracting 1.5 * 2^52 rounds to the nearest whole number.
ROUND = 6755399441055744.0
ROUND_BITS = 4843621399236968448

# pi/2 in three parts; the first two have 33 bits, so that their products with a quotient are exact.
HALF_PI_1 = 1.57079632673412561417e00
HALF_PI_2 = 6.07710050630396597660e-11
HALF_PI_3 = 2.02226624879595063154e-21
TWO_OVER_PI = 6.36619772367581382433e-01

LN2_HIGH = 6.93147180369123816490e-01
LN2_LOW = 1.90821492927058770002e-10
LOG2_E = 1.44269504088896338700e00


@piece
def sincos(x: float) -> tuple[float, float]:
    """Sine and cosine of an angle in rad (or of `Lanes` of them), |x| < 1e5.

    The polynomials on |x| <= pi/4 are those of fdlibm.
    """
    quotient = (x * TWO_OVER_PI + ROUND) - ROUND
    high = x - quotient * HALF_PI_1
    middle = quotient * HALF_PI_2
    rough = high - middle
    correction = quotient * HALF_PI_3 - ((high - rough) - middle)
    r = rough - correction
    tail = (rough - r) - correction
    z = r * r
    cube = z * r
    p = 8.33333333332248946124e-03 + z * (
        -1.98412698298579493134e-04
        + z
        * (
            2.75573137070700676789e-06
            + z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10)
        )
    )
    sine = r - ((z * (0.5 * tail - cube * p) - tail) + cube * 1.66666666666666324348e-01)
    q = 4.16666666666666019037e-02 + z * (
        -1.38888888888741095749e-03
        + z
        * (
            2.48015872894767294178e-05
            + z
            * (
                -2.75573143513906633035e-07
                + z * (2.08757232129817482790e-09 - z * 1.13596475577881948265e-11)
            )
        )
    )
    half = 0.5 * z
    w = 1.0 - half
    cosine = w + (((1.0 - w) - half) + (z * (z * q) - r * tail))
    # The quotient modulo 4, one of -2, -1, 0, 1, 2, tells the quadrant.
    quadrant = quotient - 4.0 * ((0.25 * quotient + ROUND) - ROUND)
    square = quadrant * quadrant
    odd = square == 1.0
    s = where(odd, cosine, sine)
    c = where(odd, sine, cosine)
    # Both change sign at quadrant 2, the sine alone at -1, the cosine alone at 1.
    opposite = where(square == 4.0, -1.0, 1.0)
    return where(quadrant == -1.0, -s, opposite * s), where(quadrant == 1.0, -c, opposite * c)


@piece
def exp_of_negative(x: float) -> float:
    """e^x for x <= 0; below -700 the answer is that of -700, about 1e-304."""
    x = x if x > -700.0 else -700.0
    quotient = (x * LOG2_E + ROUND) - ROUND
    high = x - quotient * LN2_HIGH
    low = quotient * LN2_LOW
    r = high - low
    tail = (high - r) - low
    # Taylor's series: on |r| <= ln(2)/2 the first term left out is below 5e-18.
    p = 1.0 / 39916800.0 + r * (1.0 / 479001600.0 + r * (1.0 / 6227020800.0))
    p = 1.0 / 40320.0 + r * (1.0 / 362880.0 + r * (1.0 / 3628800.0 + r * p))
    p = 1.0 / 120.0 + r * (1.0 / 720.0 + r * (1.0 / 5040.0 + r * p))
    p = 0.5 + r * (1.0 / 6.0 + r * (1.0 / 24.0 + r * p))
    # The last bits of quotient + ROUND hold the quotient; moved into the exponent, they are 2^q.
    bits = np.float64(quotient + ROUND).view(np.int64) - ROUND_BITS
    power_of_two = np.int64((bits + 1023) << 52).view(np.float64)
    return (1.0 + (r + (tail + r * r * p))) * power_of_two


@piece
def cube_root(x: float) -> float:
    """The cube root of x >= 0, by Halley's iteration from an estimate made of the exponent."""
    estimate = np.int64(np.float64(x).view(np.int64) // 3 + 3071306043645493248).view(np.float64)
    for _ in range(2):
        cube = estimate * estimate * estimate
        estimate = estimate * ((cube + 2.0 * x) / (2.0 * cube + x))
    # One Newton step on the residual rounds the last bit.
    square = estimate * estimate
    estimate = estimate - (square * estimate - x) / (3.0 * square)
    return estimate if x > 0.0 else 0.0


@piece
def arctan(x: float) -> float:
    """The arc tangent in rad, by the reductions and the polynomial of fdlibm."""
    a = abs(x)
    # atan(a) = atan(c) + atan((a - c) / (1 + c a)), with c = 0, 1/2, 1, 3/2 or infinity.
    over, under, high, low = a, 1.0, 0.0, 0.0
    if a > 0.4375:
        over, under = 2.0 * a - 1.0, 2.0 + a
        high, low = 4.63647609000806093515e-01, 2.26987774529616870924e-17
    if a > 0.6875:
        over, under = a - 1.0, a + 1.0
        high, low = 7.85398163397448278999e-01, 3.06161699786838301793e-17
    if a > 1.1875:
        over, under = a - 1.5, 1.0 + 1.5 * a
        high, low = 9.82793723247329054082e-01, 1.39033110312309984516e-17
    if a > 2.4375:
        over, under = -1.0, a
        high, low = 1.57079632679489655800e00, 6.12323399573676603587e-17
    t = over / under
    z = t * t
    w = z * z
    s1 = z * (
        3.33333333333329318027e-01
        + w
        * (
            1.42857142725034663711e-01
            + w
            * (
                9.09088713343650656196e-02
                + w
                * (
                    6.66107313738753120669e-02
                    + w * (4.97687799461593236017e-02 + w * 1.62858201153657823623e-02)
                )
            )
        )
    )
    s2 = w * (
        -1.99999999998764832476e-01
        + w
        * (
            -1.11111104054623557880e-01
            + w
            * (
                -7.69187620504482999495e-02
                + w * (-5.83357013379057348645e-02 - w * 3.65315727442169155270e-02)
            )
        )
    )
    angle = high - ((t * (s1 + s2) - low) - t)
    return -angle if x < 0.0 else angle
