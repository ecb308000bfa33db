"""Frequency responses of the identified drive, a black box and the record, to be compared as in the paper's Figure 4.

All are from torque to speed, where resonances stand out; a response to the angle is multiplied by j w.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike
from scipy.signal import welch

from monitor_core.arrays import Bools, Complexes, Floats
from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.structure import DELAY, Drive
from monitor_core.identification.black_boxes.arx import fit_arx
from monitor_core.identification.black_boxes.frequency_response import (
    FrequencyResponse,
    by_gradient,
    local_response,
    on_circle,
    root_of,
)
from monitor_core.identification.greybox import Estimate
from monitor_core.identification.predictor.held_drive import LinearDrive, Structure, hold_late
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


# --- Response of a drive with estimated parameters, and its uncertainty band ------------------------------------------


def held_response(
    system: LinearDrive, torque: Bools, interval_s: float, frequency_hz: ArrayLike, delay_s: float = 0.0
) -> tuple[Complexes, Complexes]:
    """G (F,) and its derivatives (F, p + 1) with respect to the parameters and, last, the delay of the torque.

        G(z) = C (zI - Ad)^-1 (Bd + Bd' / z),      z = e^{jwh}

    Ad and Bd belong to the torque held over the interval, Bd' to the part of it that acts late.  This is the response
    that spectra and discrete models of sampled records estimate, and not C (jw - A)^-1 B.

    ``torque`` (m,) says which inputs are the motor torque, which acts late by ``delay_s``, at most one interval.
    """
    _, z = on_circle(frequency_hz, interval_s)
    n, m = system.B.shape
    late = hold_late(system, torque, np.array([interval_s]), delay_s)
    now = np.concatenate([np.zeros(n, np.bool_), torque, [False]])
    X, dX = late.X[0], late.dX[0]
    b = X[:, now].sum(axis=-1) + X[:, n + m] / z[:, None]
    db = dX[:, :, now].sum(axis=-1) + dX[:, :, n + m] / z[:, None, None]
    resolvent = z[:, None, None] * np.eye(n) - X[:, :n]
    r = np.linalg.solve(resolvent, b[..., None])[..., 0]
    l = np.linalg.solve(resolvent.swapaxes(1, 2), system.C[:, None].astype(np.complex128))[..., 0]
    dG: Complexes = np.einsum("fi,pij,fj->fp", l, dX[..., :n], r) + np.einsum("fi,fpi->fp", l, db)
    dG[:, :-1] += r @ system.dC
    return np.asarray(r @ system.C, dtype=np.complex128), dG


def drive_response(
    drive: Drive,
    values: Mapping[str, float],
    interval_s: float,
    frequency_hz: ArrayLike,
    covariance: Mapping[str, ArrayLike] = MappingProxyType({}),
    delay_s: float = 0.0,
) -> FrequencyResponse:
    """The response of a drive to its torque; friction and gravity are known inputs and do not contribute.

    Args:
        drive: its structure.
        values: of all parameters, as AxisModel takes them.
        interval_s: s.
        frequency_hz: (F,) Hz.
        covariance: rows (p,) of the covariance of the estimates, by the p names in Estimate.names: "1/Ja", "delay";
            what varies with a signal ("fm per temperature") is left out, the response being that at signals of zero.
        delay_s: by which the torque acts late, s.

    A parameter of infinite variance that the response depends on makes its deviations infinite.

    Raises:
        KeyError: a name that the drive does not have, or a value that is missing.
        ValueError: a value that makes no sense; a frequency beyond half the sampling frequency.
    """
    names = tuple(covariance)
    P = np.array([*covariance.values()], dtype=np.float64).reshape(len(names), len(names))
    model = AxisModel(drive, values, ())
    free = [p for p in names if p != DELAY and " per " not in p]
    system = Structure(drive, free, model.balance()).at(model.nominal)
    f, _ = on_circle(frequency_hz, interval_s)
    torque, (intervals, late) = drive.of_torque, divmod(delay_s, interval_s)
    G, slopes = held_response(system, torque, interval_s, f, late)
    dG = np.zeros((f.size, len(names)), dtype=np.complex128)
    for i, parameter in enumerate(names):
        if parameter in free or parameter == DELAY:
            dG[:, i] = slopes[:, free.index(parameter) if parameter in free else -1]
    known = np.isfinite(np.diag(P))
    found = by_gradient(f, G, dG[:, known], root_of(P[np.ix_(known, known)]), "drive")
    lost = np.any(dG[:, ~known] != 0, axis=1)
    turns = np.exp(-2j * np.pi * f * interval_s)
    # A mean speed is the change of an angle over each interval.
    mean = (1 - turns) / interval_s if drive.mean_state >= 0 else 1.0
    return replace(
        found,
        G=found.G * mean * turns**intervals,
        sd_db=np.where(lost, np.inf, found.sd_db),
        sd_phase=np.where(lost, np.inf, found.sd_phase),
    )
