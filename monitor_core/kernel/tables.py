"""A drive in the form of the kernel: arrays of indices (shared by a batch) and of constants (one column per axis).

The drive is  x' = A(theta) x + B(theta) u,  y = C(theta) x.  All nonzero entries of A, B and C, and all their nonzero
derivatives, are *slots* of one vector V.  V is a sum of Laurent terms c * theta_1^e1 * theta_2^e2 ...: terms without a
monitored parameter are added to ``V0`` once, the others are evaluated at every sample (propagate.py).
"""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats, Indices, Ints

TORQUE, COULOMB, ONE, COSINE, SINE, WEIGHT = 0, 1, 2, 3, 4, 5
"""Kinds of input: the motor torque; tanh of the speed at a flange (Coulomb friction); the constant 1; cos and sin of
the angle at a flange (gravity); a torque that is given with each sample, that of the weight in the present pose."""
ANGLE_FUNCTIONS: Mapping[int, Callable[[Floats], Floats]] = MappingProxyType({COSINE: np.cos, SINE: np.sin})
"""Values (N,) of the inputs that depend on the angle, at angles of the flange (N,) [rad]; for use outside the kernel"""
OF_ANGLE = tuple(ANGLE_FUNCTIONS)
"""Inputs that depend on the angle."""
OF_MOTION = (COULOMB, *OF_ANGLE)
"""Inputs that depend on the motion."""

GAINS = 12
"""Filter gains of an axis: after 0, 1 .. 11 sample intervals."""


class Product(NamedTuple):
    """Indices of the product F X: A multiplies z_1 .. z_p, zeros and x (``blocks`` of them); the A_i multiply x only.

    In ``Tables`` indices count single numbers.  In the recursion, indices into arrays of lanes are multiplied by the
    number of lanes.
    """

    n: int  # states
    p: int  # monitored parameters
    blocks: int  # z_1 .. z_p, zeros, x: p + 1 made up to a multiple of four
    A_start: Indices  # (n + 1,) end of the entries of A before each row, and at last of all
    A_at: Indices  # (entries of A,) column * blocks
    more_start: Indices  # (n + 1,) range of each row's places where any A_i has an entry
    more_at: Indices  # column * blocks of each of these places
    more_slot: Indices  # (places * blocks,) slots of A_1 .. A_p there, else the 0
    part_start: Indices  # (parts + 1,) range of the entries of a row of an A_i
    part_place: Indices  # (parts,) row * blocks + i
    part_at: Indices  # columns * blocks
    part_slot: Indices  # and slots of these entries


class InputTerms(NamedTuple):
    """Products of B: first B and the B_i on u, then B on the derivatives of u with respect to a parameter."""

    row: Ints  # element of (z_1 .. z_p, x) that gets
    slot: Ints  # slot times
    col: Ints  # input
    par: Ints  # or its derivative with respect to this parameter; -1: the input itself


class OutputTerms(NamedTuple):
    """Products of C."""

    slot: Ints  # slot times
    src: Ints  # element of (z_1 .. z_p, x) goes to
    par: Ints  # psi of this parameter, or -1: to yhat


class FrictionTerms(NamedTuple):
    """Products for the speed that Coulomb friction depends on: row ``state`` of A, B and of their derivatives.

    In each list ``par`` is the parameter of z_i, A_i, B_i, or -1: x, A, B.
    """

    number: int  # inputs that are Coulomb friction
    late: int  # index of the parameter that is the delay of the torque, -1: none
    state: int  # index in x of the speed at the sensor, up to a factor; -1: none, the speed is measured
    filtered: int  # 1: the speed in x is used (angle or mean speed is measured), 0: the measured speed
    motion: OutputTerms  # A on z_i and x, A_i on x; src is an element of (z_1 .. z_p, x)
    driven: OutputTerms  # B and B_i on the other inputs; src is the input
    braked: OutputTerms  # B and B_i on the frictions


class LaurentTerms(NamedTuple):
    """Terms c * prod theta_i^e_i with a monitored parameter."""

    slot: Ints  # (terms,) slot that the term adds to, in order
    start: Ints  # (terms + 1,) range of each term's factors
    par: Ints  # (factors,) parameter
    exp: Ints  # (factors,) exponent


class Tables(NamedTuple):
    """Indices that all axes of a batch share.

    The extended vector (z_1 .. z_p, x) is flat, with n elements each.  Each product of the recursion is a row of a
    list: the slot, the element that it multiplies, and the element that the product is added to.
    """

    n: int  # states
    p: int  # monitored parameters
    m: int  # inputs
    mean: int  # index in x of the angle since the last sample, which gives a mean speed; -1: none is measured
    late: int  # index of the parameter that is the delay of the torque, -1: none
    slots: int  # length of V; V[slots] is an extra 0
    kind: Ints  # (m,) kinds of input
    A_row: Ints  # (entries of A,) row of each of the first slots, in order
    A_col: Ints
    product: Product
    inputs: InputTerms
    outputs: OutputTerms
    friction: FrictionTerms
    terms: LaurentTerms


class Constants(NamedTuple):
    """Numbers of each axis, axis last.  SI units; times in microseconds where the name ends in _us."""

    V0: Floats  # (slots, W) constant part of V
    coef: Floats  # (terms, W) coefficient of each term
    weight: Floats  # (entries of A, W) d_col / d_row of the balancing diagonal d
    K: Floats  # (GAINS n, W) filter gain after 0, 1, 2 .. intervals; 0 is the paper's output error
    interval: Floats  # (W,) s, nominal
    rest: Floats  # (n, W) state of the drive moving rigidly at y = 1
    rigid: Floats  # (n, W) where y is an angle: state of the drive moving rigidly at a speed of 1; else zeros
    theta0: Floats  # (p, W) nominal values
    lower: Floats  # (p, W) bounds of theta
    upper: Floats  # (p, W)
    h: Floats  # (p, W) thresholds of the CUSUM tests
    P_uninformed: Floats  # (p, W) P_ii if only the size of a parameter is known
    scale: Floats  # (p, W) sizes of theta_i
    alpha1: Floats  # (p, W) nu = alpha1 sqrt(lambda_0 P_ii) + allowance
    allowance: Floats  # (p, W) allowance for differences between healthy records, in the unit of theta
    u_scale: Floats  # (m, W) factor in inputs: tanh(u_scale speed), cos(u_scale angle), sin(u_scale angle)
    lam: Floats  # (W,) forgetting factor
    lam0: Floats  # (W,) innovation variance that nu uses
    lam_slow: Floats  # (W,) forgetting factor of the running innovation variance
    delay: Floats  # (W,) s, by which the torque acts late
    gap_us: Floats  # (W,) a longer interval re-initialises the predictor
    settle_us: Floats  # (W,) no update of theta for this time after a restart
    seed: Floats  # (W,) updates of the run that finds P(0); its second half is averaged
    naming_samples: Floats  # (W,) samples to learn from a crossing to the evidence, and between two evidences
    floor: Floats  # (W,) least share of the commissioned information; 0: none
    min_excitation: Floats  # (W,) least share of the steady mean of psi' P psi; 0: none
    lost_us: Floats  # (W,) no update of theta for this time after each lost sample except the first
    outlier: Floats  # (W,) standard deviations beyond which an innovation is an outlier; 0: never
    outlier_least: Floats  # (W,) lower bound of that limit, in the unit of the output
    outlier_credit: Floats  # (W,) number of outliers in a row that are rejected
    joint: Floats  # (W,) 1: the state is corrected together with theta
    tested: Floats  # (W,) 0: no test runs
    widen: Floats  # (W,) least P_ii / P(0)_ii after an alarm; 0: P stays
    span: Floats  # (W,) updates between two applications of the information floor


def constant_rows(t: Tables) -> int:
    """Number of rows of the array of the Constants of a batch."""
    return t.slots + t.terms.slot.size + t.A_row.size + (GAINS + 2) * t.n + 8 * t.p + t.m + 19
