"""What a drive is to the kernel: arrays of indices (shared by a bank) and of constants (one column per axis).

The drive is  x' = A(theta) x + B(theta) u,  y = C(theta) x.  All entries of A, B and C that are not zero,
and all their derivatives that are not zero, are *slots* of one vector V.  V is a sum of Laurent terms
c * theta_1^e1 * theta_2^e2 ...: terms without a monitored parameter are folded into ``V0`` once, the others
are evaluated at every sample (laurent.py).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int64]
Floats = NDArray[np.float64]

TORQUE, COULOMB, ONE = 0, 1, 2
"""Kinds of input: the motor torque; tanh(motor speed / speed_scale); the constant 1."""


class Tables(NamedTuple):
    """Indices that all axes of a bank share.

    Slots are ordered: entries of A row by row, of B, of C, then dA/dtheta_i, dB/dtheta_i, dC/dtheta_i.
    The ranges of each group are in ``ends`` (six cumulative ends).
    """

    n: int  # states
    p: int  # monitored parameters
    m: int  # inputs
    speed_state: int  # index of the motor speed in x
    filtered_speed: int  # 1: friction uses the speed in x (angle is measured), 0: the measured speed
    ends: Ints  # (6,) ends of the slot groups A, B, C, dA, dB, dC
    row: Ints  # (slots,) row of the slot's entry (0 for C)
    col: Ints  # (slots,) column of the slot's entry (input for B)
    par: Ints  # (slots,) parameter of a derivative slot, -1 for A, B, C
    kind: Ints  # (m,) TORQUE, COULOMB or ONE
    term_slot: Ints  # (terms,) slot that the term adds to
    factor_start: Ints  # (terms + 1,) range of each term's factors
    factor_par: Ints  # (factors,) parameter
    factor_exp: Ints  # (factors,) exponent


class Constants(NamedTuple):
    """Numbers of each axis, axis last.  SI units; times in microseconds where the name ends in _us."""

    V0: Floats  # (slots, W) constant part of V
    coef: Floats  # (terms, W) coefficient of each term
    weight: Floats  # (entries of A, W) d_col / d_row of the balancing diagonal d
    K: Floats  # (n, W) filter gain of the innovations form; 0 is the paper's output error
    rest: Floats  # (n, W) state of the drive moving rigidly at y = 1
    theta0: Floats  # (p, W) nominal values
    lower: Floats  # (p, W) bounds of theta
    upper: Floats  # (p, W)
    h: Floats  # (p, W) thresholds of the CUSUM tests
    lam: Floats  # (W,) forgetting factor
    lam0: Floats  # (W,) innovation variance that nu uses
    alpha1: Floats  # (W,)
    lam_slow: Floats  # (W,) forgetting factor of the running innovation variance
    speed_scale: Floats  # (W,) of tanh(speed / speed_scale)
    delay: Floats  # (W,) s, by which the torque acts late
    gap_us: Floats  # (W,) a longer interval re-initialises the predictor
    settle_us: Floats  # (W,) no update of theta for so long after that
    seed: Floats  # (W,) updates of the run that finds P(0); its second half is averaged
    calm: Floats  # (W,) samples below nu that end an alarm episode


def constant_rows(n: int, p: int, slots: int, terms: int, entries: int) -> int:
    """Number of rows of the array that holds the Constants of a bank."""
    return slots + terms + entries + 2 * n + 4 * p + 10
