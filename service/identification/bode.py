"""Frequency responses in one picture, as in the paper's Figure 4: the drive found, a black box, the record itself.

All are from torque to speed, so that resonances stand out; where the angle was measured, times j w.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import welch

from monitor_core.arrays import Floats
from monitor_core.drive.structure import Drive
from monitor_core.identification.arx import fit_arx
from monitor_core.identification.drive_response import drive_response
from monitor_core.identification.estimate import Estimate
from monitor_core.identification.frequency import FrequencyResponse
from monitor_core.identification.local_polynomial import local_response
from monitor_core.identification.problem import Problem
from monitor_core.identification.record import Record
from monitor_core.identification.resampling import decimate, resample
from monitor_core.identification.spectral import spectral_response

_POINTS = 300
_PERIODS = 4.0
"""The lowest frequency has at least so many periods in the longest record."""
_EXCITED = 3e-3
"""Of the largest density of the torque: what is below is not excited, but noise that a controller answers to."""
_NYQUIST = 0.95
_FASTER = 5.0
"""Samples in a period of the highest frequency, at least."""
_LARGEST = 100
"""Order of the black box, at most."""
_LONGEST = 60_000
"""Samples that the black box and the spectra look at: more only take longer."""


@dataclass(frozen=True, eq=False)
class Bode:
    """``drive`` with what was found, ``before`` with nominal values, if known; the others where the records allow."""

    drive: FrequencyResponse
    before: FrequencyResponse | None
    black_box: FrequencyResponse | None
    measured: FrequencyResponse | None
    words: tuple[str, ...]


def bode_of(estimate: Estimate, start: Problem | None, records: Sequence[Record]) -> Bode:
    """The frequency responses over the band in which the records have torque.

    Args:
        estimate: what was found.
        start: with the values before; None: there were none.
        records: that it was found from.
    """
    f, h = band(records), estimate.interval_s
    shown = _as_speed if records[0].quantity == "angle" else _as_it_is
    regular, words = _regular(records, h)
    found = _drive(
        estimate.drive, estimate.values, h, f, estimate.delay_s, "drive, identified",
        names=estimate.names, covariance=estimate.covariance,
    )  # fmt: skip
    before = None
    if start is not None:
        before = shown(_drive(start.drive, start.nominal, h, f, start.delay_s, "drive, nominal before"))
    black_box, no_box = _tried("black box", lambda: _black_box(regular, f))
    measured, no_spectrum = _tried("frequency response of the record", lambda: _measured(regular, f))
    return Bode(
        shown(found),
        before,
        black_box and shown(black_box),
        measured and shown(measured),
        (*words, *no_box, *no_spectrum),
    )


def _drive(
    drive: Drive,
    values: Mapping[str, float],
    interval_s: float,
    f: Floats,
    delay_s: float,
    name: str,
    names: Sequence[str] = (),
    covariance: Floats | None = None,
) -> FrequencyResponse:
    """As ``drive_response``, with whole intervals of delay, too."""
    whole, rest = divmod(delay_s, interval_s)
    found = drive_response(
        drive, values, interval_s, f, names=names, covariance=covariance, delay_s=rest, name=name
    )
    turns = np.exp(-2j * np.pi * f * interval_s)
    mean = (
        (1 - turns) / interval_s if drive.mean_state >= 0 else 1.0
    )  # of the angle: the way of each interval
    return replace(found, G=found.G * mean * turns**whole)


def band(records: Sequence[Record]) -> Floats:
    """Frequencies (F,), Hz, evenly on a logarithmic axis, from the lowest to the highest that the torque excites."""
    longest = max(records, key=len)
    nyquist = 0.5 / longest.interval_s
    f, density = welch(longest.u, 1 / longest.interval_s, nperseg=min(len(longest), 2048))
    excited = f[density > _EXCITED * density.max()]
    low = max(_PERIODS / longest.duration_s, float(excited[excited > 0].min(initial=nyquist)) / 2)
    high = min(_NYQUIST * nyquist, float(excited.max(initial=2 * low)))
    return np.geomspace(min(low, high / 2), high, _POINTS)


def _regular(records: Sequence[Record], interval_s: float) -> tuple[list[Record], tuple[str, ...]]:
    """The records on one grid of times, and what that cost."""
    cut = [record.select(slice(0, _LONGEST)) for record in records]
    scatter = max(record.jitter_s / record.interval_s for record in cut)
    if scatter < _EVEN:
        return cut, ()
    found = [resample(record, interval_s) for record in cut]
    words = "For the black box and the spectra the record was resampled: its samples are not evenly spaced."
    return [one.record for one in found], (words,)


_EVEN = 0.01
"""Scatter of the intervals, relative."""


def _tried(
    what: str, find: Callable[[], FrequencyResponse]
) -> tuple[FrequencyResponse | None, tuple[str, ...]]:
    try:
        return find(), ()
    except ValueError as error:
        return None, (f"No {what}: {error}.",)


def _black_box(records: Sequence[Record], f: Floats) -> FrequencyResponse:
    """ARX; of samples far faster than the band fewer, since its order counts samples, and the band's time is long."""
    h = max(record.interval_s for record in records)
    every = max(1, int(1 / (_FASTER * f[-1] * h)))
    thinned = [decimate(record, every).record for record in records] if every > 1 else list(records)
    samples = sum(len(record) for record in thinned)
    model = fit_arx(thinned, "aic", largest=max(1, min(_LARGEST, samples // 20)))
    found = model.response(f)
    return replace(found, name=f"{found.name}, every {1e3 * every * h:.3g} ms") if every > 1 else found


def _measured(records: Sequence[Record], f: Floats) -> FrequencyResponse:
    """By local polynomials, or, where samples are missing, by averaged spectra."""
    try:
        return local_response(records, f, name="record, local polynomials")
    except ValueError:
        return spectral_response(records, name="record, spectra").between(f[0], f[-1])


def _as_it_is(one: FrequencyResponse) -> FrequencyResponse:
    return one


def _as_speed(one: FrequencyResponse) -> FrequencyResponse:
    return replace(one, G=one.G * 2j * np.pi * one.frequency_hz)
