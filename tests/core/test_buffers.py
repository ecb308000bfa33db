"""Work arrays of the kernel: the compiler is told that they do not overlap."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations
from typing import Any

import numpy as np
import pytest

from monitor_core.kernel.buffers import make_buffers, product_of_lanes
from monitor_core.monitoring import AxisBatch
from tests.core.cases import BY_NAME, as_columns, record

CASE = BY_NAME["angle-friction"]


def batch_of(axes: int) -> AxisBatch:
    return AxisBatch([CASE.model] * axes, [CASE.settings()] * axes)


def arrays(value: Any) -> Iterator[np.ndarray[Any, Any]]:
    if isinstance(value, np.ndarray):
        yield value
    elif isinstance(value, tuple):
        for part in value:
            yield from arrays(part)


@pytest.mark.parametrize("lanes", [1, 8])
def test_no_work_arrays_overlap(lanes: int) -> None:
    found = list(arrays(make_buffers(batch_of(1)._tables, (100, 90, 80), lanes)))
    assert len(found) == 48
    assert all(array.flags.c_contiguous and not array.any() for array in found)
    assert not any(np.shares_memory(a, b) for a, b in combinations(found, 2))


def test_product_of_lanes() -> None:
    product = batch_of(1)._tables.product
    assert product_of_lanes(product, 1) is product
    wide = product_of_lanes(product, 24)
    for name, factor in {"A_at": 8, "more_at": 8, "part_place": 8, "part_at": 8, "part_slot": 24}.items():
        narrow, found = getattr(product, name), getattr(wide, name)
        assert found.dtype == narrow.dtype
        assert (found == narrow * factor).all()
    same = product._fields[:4] + product._fields[5:6] + product._fields[7:9]
    assert all(getattr(wide, name) is getattr(product, name) for name in same)


def test_an_axis_has_nothing_of_the_one_before_it(seed: int) -> None:
    t_us, u, y = as_columns(record(seed, CASE, 100))[:3]
    three = [0, 0, 0]
    _, traces = batch_of(3).run_traced(t_us[:, three], u[:, three], y[:, three])
    _, trace = batch_of(1).run_traced(t_us, u, y)
    for found, expected in zip(traces, trace, strict=True):
        for a in range(3):
            np.testing.assert_array_equal(found[..., a], expected[..., 0])
