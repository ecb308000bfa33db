"""Long records are cut to the stretch with most motion, short ones stay."""

from __future__ import annotations

import numpy as np
import pytest

from monitor_core.identification import Record
from monitor_core.identification.records.lively_parts import lively_parts


def record(count: int, lively_from: int, length: int, name: str) -> Record:
    """An angle that hardly moves, but for a stretch."""
    t = np.asarray(0.005 * np.arange(count), np.float64)
    speed = np.full(count, 0.01)
    speed[lively_from : lively_from + length] = 1.0
    return Record(t, np.zeros(count), np.cumsum(speed), "angle", name)


@pytest.mark.parametrize("start", [0, 300, 700])
def test_the_liveliest_stretch_of_a_long_record(start: int) -> None:
    own = record(1000, start, 300, "long")
    (part,) = lively_parts([own], 300)
    assert len(part) == 300
    assert part.t[0] == pytest.approx(own.t[start], abs=0.006)


def test_short_records_stay() -> None:
    records = [record(n, 0, 10, str(n)) for n in (1000, 100, 600)]
    parts = lively_parts(records, 900)
    assert [len(part) for part in parts] == [400, 100, 400]
    assert parts[1] is records[1]
    assert [part is own for part, own in zip(lively_parts(records, 1700), records, strict=True)] == [True] * 3
