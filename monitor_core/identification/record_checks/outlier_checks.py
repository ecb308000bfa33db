"""Samples that cannot be what the axis did, and samples that are missing."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from monitor_core.arrays import Floats
from monitor_core.identification.record import Bools, Record
from monitor_core.identification.record_checks.finding import Finding
from monitor_core.samples import PHYSICAL_LIMITS

_HALF = 2
"""Samples on either side of the running median: a peak of one or two samples stands out."""
_STANDS_OUT = 10.0
"""Times what 90 % of the samples stay below: for Gaussian noise that is 16 standard deviations."""
_VISIBLE = 0.2
"""As part of the range in which 90 % of the values lie: less than that does little harm."""
_PEAK = 2.0
"""Times the difference of what comes before and after: a peak comes back, a jump of the torque does not."""
_REFUSE = 0.01
"""Part of all samples: where there are so many, those that do not stand out will not be right either."""


def strange(record: Record) -> Iterator[Finding]:
    """Absurd numbers, outliers, missing samples."""
    yield from _absurd(record)
    yield from _outliers(record)
    missing = 1 - float(np.mean(record.measured))
    if missing > 0:
        yield Finding(
            "missing",
            "refuse" if missing > 0.5 else "warn",
            f"the {record.quantity} is missing or not finite at {np.count_nonzero(~record.measured)} of {len(record)} "
            f"samples, {100 * missing:.2g} %",
            missing,
        )


def outliers(values: Floats) -> Bools:
    """Which of the values (N,) stand out from their neighbours; those that are not finite do not."""
    out = np.zeros(values.shape, np.bool_)
    known = np.flatnonzero(np.isfinite(values))
    if known.size < 2 * _HALF + 1:
        return out
    v = values[known]
    distance = abs(v - _median(v, _HALF, _HALF))
    jump = abs(_median(v, 0, 2 * _HALF) - _median(v, 2 * _HALF, 0))
    low, high = np.quantile(v, (0.05, 0.95))
    far = distance > max(_STANDS_OUT * np.quantile(distance, 0.9), _VISIBLE * (high - low))
    out[known] = far & (distance > _PEAK * jump)
    return out


def _median(values: Floats, before: int, after: int) -> Floats:
    """Of each value and so many before and after it (N,)."""
    padded = np.pad(values, (before, after), mode="edge")
    return np.asarray(np.median(sliding_window_view(padded, before + after + 1), axis=1))


def _absurd(record: Record) -> Iterator[Finding]:
    for what, unit, values in _quantities(record):
        beyond = abs(np.nan_to_num(values)) > PHYSICAL_LIMITS[what]
        if beyond.any():
            largest = float(np.nanmax(abs(values)))
            yield Finding(
                "absurd",
                "refuse",
                f"the {what} is beyond {PHYSICAL_LIMITS[what]:g} {unit} at {np.count_nonzero(beyond)} samples, up to "
                f"{largest:.3g} {unit}: no motor does that",
                largest,
            )


def _outliers(record: Record) -> Iterator[Finding]:
    for what, unit, values in _quantities(record):
        where = np.flatnonzero(outliers(values))
        if where.size:
            k = int(where[np.argmax(abs(values[where]))])
            share = where.size / len(record)
            yield Finding(
                "outliers",
                "refuse" if share > _REFUSE else "warn",
                f"{where.size} values of the {what} stand out from their neighbours, the first at "
                f"{record.t[where[0]] - record.t[0]:.3f} s, the last at {record.t[where[-1]] - record.t[0]:.3f} s, the "
                f"largest is {values[k]:.4g} {unit}",
                where.size,
            )


def _quantities(record: Record) -> Iterator[tuple[str, str, Floats]]:
    yield "torque", "N m", record.u
    yield record.quantity, record.unit, record.y
