"""Frequency responses of the identified drive, a black box and the record, to be compared as in the paper's Figure 4.

All are from torque to speed, where resonances stand out; a response to the angle is multiplied by j w.
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
"""Periods of the lowest frequency in the longest record, at least."""
_EXCITED = 3e-3
"""Share of the largest spectral density of the torque below which a frequency counts as not excited: there the torque
is a controller's answer to noise."""
_NYQUIST = 0.95
_EVEN = 0.01
"""Relative scatter of the intervals below which samples count as evenly spaced."""
_FASTER = 5.0
"""Samples in a period of the highest frequency, at least."""
_LARGEST = 100
"""Largest order of the black box."""
_LONGEST = 60_000
"""Most samples for the black box and the spectra: more only take longer."""


@dataclass(frozen=True, eq=False)
class Bode:
    """``drive`` has the estimates, ``before`` the nominal values, if known; the others may be None."""

    drive: FrequencyResponse
    before: FrequencyResponse | None
    black_box: FrequencyResponse | None
    measured: FrequencyResponse | None
    words: tuple[str, ...]


def bode_of(estimate: Estimate, start: Problem | None, records: Sequence[Record]) -> Bode:
    """The frequency responses over the band in which the records have torque.

    Args:
        estimate: the identified drive.
        start: the problem with the values before; None: there were none.
        records: the records that were fitted.
    """
    f, h = band(records), estimate.interval_s
    shown = _as_speed if records[0].quantity == "angle" else _unchanged
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
    """As ``drive_response``, also for delays of more than an interval."""
    intervals, rest = divmod(delay_s, interval_s)
    found = drive_response(
        drive, values, interval_s, f, names=names, covariance=covariance, delay_s=rest, name=name
    )
    turns = np.exp(-2j * np.pi * f * interval_s)
    mean = (
        (1 - turns) / interval_s if drive.mean_state >= 0 else 1.0
    )  # for an angle: its change over each interval
    return replace(found, G=found.G * mean * turns**intervals)


def band(records: Sequence[Record]) -> Floats:
    """Frequencies (F,) [Hz], evenly spaced on a logarithmic axis, over the band that the torque excites."""
    longest = max(records, key=len)
    nyquist = 0.5 / longest.interval_s
    f, density = welch(longest.u, 1 / longest.interval_s, nperseg=min(len(longest), 2048))
    excited = f[density > _EXCITED * density.max()]
    low = max(_PERIODS / longest.duration_s, float(excited[excited > 0].min(initial=nyquist)) / 2)
    high = min(_NYQUIST * nyquist, float(excited.max(initial=2 * low)))
    return np.geomspace(min(low, high / 2), high, _POINTS)


def _regular(records: Sequence[Record], interval_s: float) -> tuple[list[Record], tuple[str, ...]]:
    """The records on a uniform grid, and a sentence where they had to be resampled."""
    cut = [record.select(slice(0, _LONGEST)) for record in records]
    scatter = max(record.jitter_s / record.interval_s for record in cut)
    if scatter < _EVEN:
        return cut, ()
    found = [resample(record, interval_s) for record in cut]
    words = "For the black box and the spectra the record was resampled: its samples are not evenly spaced."
    return [resampled.record for resampled in found], (words,)


def _tried(
    name: str, find: Callable[[], FrequencyResponse]
) -> tuple[FrequencyResponse | None, tuple[str, ...]]:
    try:
        return find(), ()
    except ValueError as error:
        return None, (f"No {name}: {error}.",)


def _black_box(records: Sequence[Record], f: Floats) -> FrequencyResponse:
    """ARX model; samples much faster than the band are decimated, as the order of the model counts samples."""
    h = max(record.interval_s for record in records)
    every = max(1, int(1 / (_FASTER * f[-1] * h)))
    thinned = [decimate(record, every).record for record in records] if every > 1 else list(records)
    samples = sum(len(record) for record in thinned)
    model = fit_arx(thinned, "aic", largest=max(1, min(_LARGEST, samples // 20)))
    found = model.response(f)
    return replace(found, name=f"{found.name}, every {1e3 * every * h:.3g} ms") if every > 1 else found


def _measured(records: Sequence[Record], f: Floats) -> FrequencyResponse:
    """From local polynomials; from averaged spectra where samples are missing."""
    try:
        return local_response(records, f, name="record, local polynomials")
    except ValueError:
        return spectral_response(records, name="record, spectra").between(f[0], f[-1])


def _unchanged(response: FrequencyResponse) -> FrequencyResponse:
    return response


def _as_speed(response: FrequencyResponse) -> FrequencyResponse:
    return replace(response, G=response.G * 2j * np.pi * response.frequency_hz)
