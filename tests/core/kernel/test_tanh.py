"""The kernel's own tanh beside that of a wider number."""

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.kernel.compile import entry
from monitor_core.kernel.friction import tanh

SIZES = (1e-300, 1e-12, 1e-3, 0.1, 0.3, 1.0, 3.0, 10.0, 1e6)
EDGES = (0.0, 5e-324, 19.0, 19.0625, 20.0, 20.0625, 1e308, np.inf)


@entry
def each(x: Floats, out: Floats) -> None:
    for a in range(x.size):
        out[a] = tanh(x[a])


def tanh_all(x: Floats) -> Floats:
    out = np.empty_like(x)
    each(x, out)
    return out


def test_within_three_units_of_the_last_place(seed: int) -> None:
    rng = np.random.default_rng(seed)
    x = np.concatenate([size * rng.standard_normal(20_000) for size in SIZES] + [EDGES])
    right = np.tanh(x.astype(np.longdouble))
    assert (np.abs(tanh_all(x) - right) <= 3 * np.spacing(np.abs(right).astype(float))).all()
    assert (np.abs(tanh_all(x)) <= 1).all()


def test_odd_and_never_a_number_of_none(seed: int) -> None:
    rng = np.random.default_rng(seed)
    x = np.concatenate([3 * rng.standard_normal(1000), EDGES])
    assert tanh_all(-x).tobytes() == (-tanh_all(x)).tobytes()
    assert np.isnan(tanh_all(np.array([np.nan]))).all()


def test_alone_as_beside_others(seed: int) -> None:
    rng = np.random.default_rng(seed)
    x = 3 * rng.standard_normal(101)
    assert np.concatenate([tanh_all(x[a : a + 1]) for a in range(x.size)]).tobytes() == tanh_all(x).tobytes()
