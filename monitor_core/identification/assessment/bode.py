"""Frequency responses of the identified drive, a black box and the record, to be compared as in the paper's Figure 4.

All are from torque to speed, where resonances stand out; a response to the angle is multiplied by j w.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import welch

from monitor_core.arrays import Floats
from monitor_core.identification.assessment.drive_response import drive_response
from monitor_core.identification.black_boxes.arx import fit_arx
from monitor_core.identification.black_boxes.frequency_response import (
    FrequencyResponse,
    local_response,
)
from monitor_core.identification.greybox import Estimate
from monitor_core.identification.problem import Problem
from monitor_core.identification.records.measured_record import Record
from monitor_core.identification.records.uniform_grid import grid_interval, resample

_FREQUENCIES = 300
_MIN_PERIODS = 4.0
"""Least number of periods of the lowest frequency in the longest record."""
_MIN_EXCITATION = 3e-3
"""Share of the largest spectral density of the torque below which a frequency counts as not excited: there the torque
is a controller's answer to noise."""
_MAX_OF_NYQUIST = 0.95
_MAX_INTERVAL_SCATTER = 0.01
"""Relative scatter of the intervals below which samples count as evenly spaced."""
_MIN_PERIOD_SAMPLES = 5.0
"""Least number of samples in a period of the highest frequency."""
_MAX_ORDER = 100
"""Largest order of the black box."""
_MIN_SAMPLES = 400
"""Least number of samples that remain of the shortest record after decimation: the filter takes 18 at each end."""
_MAX_SAMPLES = 60_000
"""Largest number of samples for the black box and the spectra: more only take longer."""


@dataclass(frozen=True, eq=False)
class Bode:
    """Frequency responses: ``drive`` with the estimates, ``before`` with the nominal values; None: not known."""

    drive: FrequencyResponse
    before: FrequencyResponse | None
    black_box: FrequencyResponse | None
    measured: FrequencyResponse | None
    words: tuple[str, ...]


def bode_of(estimate: Estimate, start: Problem | None, records: Sequence[Record]) -> Bode:
    """The frequency responses over the band in which the records have torque.

    Args:
        estimate: the identified drive.
        start: the problem with the nominal values before the fit; None: there were none.
        records: the records that were fitted.
    """
    f, h = band(records), estimate.interval_s
    regular, words = _regular(records, h)
    covariance = dict(zip(estimate.names, estimate.covariance, strict=True))
    found = drive_response(estimate.drive, estimate.values, h, f, covariance, estimate.delay_s)
    found, before = replace(found, name="drive, identified"), None
    if start is not None:
        before = drive_response(start.drive, start.nominal, h, f, delay_s=start.delay_s)
        before = replace(before, name="drive, nominal before")
    black_box, no_box = _tried("black box", lambda: _black_box(regular, f))
    measured, no_spectrum = _tried("frequency response of the record", lambda: local_response(regular, f))
    if records[0].quantity == "angle":
        found = _as_speed(found)
        before, black_box, measured = (curve and _as_speed(curve) for curve in (before, black_box, measured))
    return Bode(found, before, black_box, measured, (*words, *no_box, *no_spectrum))


def band(records: Sequence[Record]) -> Floats:
    """Frequencies (F,) [Hz], evenly spaced on a logarithmic axis, over the band that the torque excites."""
    longest = max(records, key=len)
    nyquist = 0.5 / longest.interval_s
    f, density = welch(longest.u, 1 / longest.interval_s, nperseg=min(len(longest), 2048))
    excited = f[density > _MIN_EXCITATION * density.max()]
    low = max(_MIN_PERIODS / longest.duration_s, float(excited[excited > 0].min(initial=nyquist)) / 2)
    high = min(_MAX_OF_NYQUIST * nyquist, float(excited.max(initial=2 * low)))
    return np.geomspace(min(low, high / 2), high, _FREQUENCIES)


def _regular(records: Sequence[Record], interval_s: float) -> tuple[list[Record], tuple[str, ...]]:
    """The records on a uniform grid, and a sentence if they had to be resampled."""
    cut = [record.select(slice(0, _MAX_SAMPLES)) for record in records]
    scatter = max(record.jitter_s / record.interval_s for record in cut)
    if scatter < _MAX_INTERVAL_SCATTER:
        return cut, ()
    words = "For the black box and the spectra the record was resampled: its samples are not evenly spaced."
    # Where times are in whole milliseconds, the usual interval may be longer than the mean one of the drive.
    coarsest_s = max(interval_s, *(grid_interval(record) for record in cut))
    return [resample(record, coarsest_s) for record in cut], (words,)


def _tried(name: str, find: Callable[[], FrequencyResponse]) -> tuple[FrequencyResponse | None, tuple[str, ...]]:
    try:
        return find(), ()
    except ValueError as error:
        return None, (f"No {name}: {error}.",)


def _black_box(records: Sequence[Record], f: Floats) -> FrequencyResponse:
    """ARX model; samples much faster than the band are decimated, as the order of the model counts samples."""
    h = max(record.interval_s for record in records)
    every = max(1, min(int(1 / (_MIN_PERIOD_SAMPLES * f[-1] * h)), min(map(len, records)) // _MIN_SAMPLES))
    thinned = [resample(r, every * grid_interval(r)) if every > 1 else r for r in records]
    samples = sum(len(record) for record in thinned)
    model = fit_arx(thinned, largest=max(1, min(_MAX_ORDER, samples // 20)))
    found = model.response(f)
    return replace(found, name=f"{found.name}, every {1e3 * every * h:.3g} ms") if every > 1 else found


def _as_speed(response: FrequencyResponse) -> FrequencyResponse:
    return replace(response, G=response.G * 2j * np.pi * response.frequency_hz)
