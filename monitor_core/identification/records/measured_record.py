"""A measured record of one axis: torque, and angle or speed, at times that need not be regular."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeVar

import numpy as np

from monitor_core.arrays import Bools, Floats, Ints
from monitor_core.drive.structure import OUTPUT_UNITS, Output
from monitor_core.samples import SampleBlock

_Array = TypeVar("_Array", Floats, Bools)
_LOST = 1.5
"""An interval longer than this number of median intervals contains a gap or lost samples."""
GAP = 10.0
"""Length of a gap in typical intervals, during which the torque is not known; by default the daemon restarts its
predictor after it."""
_SPEED_STEP = 10
"""Number of samples over which the speed of an angle is taken"""
_RARELY = 0.99
"""Share of the time in which a speed is not exceeded"""


@dataclass(frozen=True, eq=False)
class Record:
    """A record of N samples, two at least.

    The torque is held: ``u[k]`` acts from ``t[k]`` to ``t[k+1]``, and ``y[k]`` was measured at ``t[k]``, before
    ``u[k]`` could act.  The intervals may differ: a model that is discretised with the actual intervals loses nothing
    by jitter or lost samples, so there is no need to resample.

    ``y`` is NaN exactly where it was not measured, so that it is not used there by mistake.  The arrays of a record
    cannot be changed; records made from it share those that are the same.

    Args:
        t: (N,) times, s, increasing.
        u: (N,) motor torque, N m.
        y: (N,) motor angle, rad, or speed, rad/s; NaN or infinite: not measured.
        quantity: which of the two.
        name: as shown to the user, for instance the name of the file.
        valid: (N,) whether y was measured; None: wherever it is finite.  See ``measured``.
        signals: (N,) each, further measured signals by name (reference, temperature, angles of other axes); NaN
            where they were not measured.
        gate: (N,) whether the gates of the axis are open, as in the monitor; None: always.  Where they are closed the
            prediction goes on, but its errors do not count, and the torque need not be explained.

    Raises:
        ValueError: arrays of different length, fewer than two samples, times that do not increase, torque that is
            not finite; the text says where.
    """

    t: Floats
    u: Floats
    y: Floats
    quantity: Output
    name: str = ""
    valid: Bools | None = None
    signals: Mapping[str, Floats] = field(default_factory=dict)
    gate: Bools | None = None

    def __post_init__(self) -> None:
        if self.quantity not in ("speed", "angle"):
            raise ValueError(f"{self._what}: the quantity {self.quantity!r} is neither speed nor angle")
        t, u, y = (_fixed(np.asarray(values, np.float64)) for values in (self.t, self.u, self.y))
        signals = {name: _fixed(np.asarray(values, np.float64)) for name, values in self.signals.items()}
        valid = _fixed(np.ones(t.shape, np.bool_) if self.valid is None else np.asarray(self.valid, np.bool_))
        gate = None if self.gate is None else _fixed(np.asarray(self.gate, np.bool_))
        gated = {} if gate is None else {"gate": gate}
        self._check_shapes({"t": t, "u": u, "y": y, "valid": valid, **signals, **gated})
        self._check_times(t)
        if not np.isfinite(u).all():
            k = _first(~np.isfinite(u))
            raise ValueError(f"{self._what}: the torque of sample {k} is {u[k]}; leave such samples out")
        if valid.shape == y.shape and not np.array_equal(valid, np.isfinite(y)):
            valid = _fixed(valid & np.isfinite(y))
            y = _fixed(np.where(valid, y, np.nan))
        for name, values in {"t": t, "u": u, "y": y, "valid": valid, "signals": signals, "gate": gate}.items():
            object.__setattr__(self, name, values)

    @classmethod
    def from_samples(
        cls, samples: SampleBlock, quantity: Output, signals: Sequence[str] = (), start_s: float = 0.0
    ) -> Record:
        """The record of a block of samples; ``signals`` names the columns of its auxiliary signals.

        Times are counted from ``start_s`` at the first sample: those since 1970 have no digits left for microseconds.

        Raises:
            ValueError: as of a record; a signal has no column, or a column no name.
        """
        t: Floats = np.multiply(samples.t_us - samples.t_us[:1] + round(1e6 * start_s), 1e-6)
        columns = () if samples.signals is None else samples.signals.T
        named = dict(zip(signals, columns, strict=True))
        return cls(t, samples.u, samples.y, quantity, samples.name, None, named, samples.gate)

    def __len__(self) -> int:
        """Number of samples N."""
        return self.t.size

    @property
    def measured(self) -> Bools:
        """(N,) whether y was measured there: ``valid``, which is never None once the record is made."""
        assert self.valid is not None
        return self.valid

    @property
    def judged(self) -> Bools:
        """(N,) whether y was measured while the gates were open."""
        return self.measured if self.gate is None else self.measured & self.gate

    @property
    def intervals(self) -> Floats:
        """(N-1,) s, from each sample to the next."""
        return np.diff(self.t)

    @property
    def interval_s(self) -> float:
        """The typical interval, s: the median, which gaps do not move."""
        return float(np.median(self.intervals))

    @property
    def mean_interval_s(self) -> float:
        """The mean interval, s, without gaps and lost samples.

        Where the sampling alternates between 10 and 12 ms the median would be one of these.
        """
        return float(self._regular.mean())

    @property
    def _regular(self) -> Floats:
        return self.intervals[self.intervals < _LOST * self.interval_s]

    @property
    def duration_s(self) -> float:
        """From the first to the last sample, s."""
        return float(self.t[-1] - self.t[0])

    @property
    def jitter_s(self) -> float:
        """Standard deviation, s, of the intervals below 1.5 typical ones: gaps and lost samples are no jitter."""
        return float(self._regular.std())

    @property
    def unit(self) -> str:
        """Unit of y."""
        return OUTPUT_UNITS[self.quantity]

    def select(self, samples: slice | Bools | Ints) -> Record:
        """The record with only these samples; the torque is held over the samples between them.

        Raises:
            ValueError: fewer than two are left, or they are not in the order of time.
        """
        signals = {name: values[samples] for name, values in self.signals.items()}
        t, u, y = (values[samples] for values in (self.t, self.u, self.y))
        gate = None if self.gate is None else self.gate[samples]
        return Record(t, u, y, self.quantity, self.name, self.measured[samples], signals, gate)

    def without(self, samples: slice | Bools | Ints) -> Record:
        """The record with y at these samples marked as not measured, as for an outlier or a fault of the sensor."""
        valid = self.measured.copy()
        valid[samples] = False
        return replace(self, valid=valid)

    @property
    def _what(self) -> str:
        return f"record {self.name}" if self.name else "record"

    def _check_shapes(self, arrays: Mapping[str, Floats | Bools]) -> None:
        for name, values in arrays.items():
            if values.ndim != 1 or values.shape != arrays["t"].shape:
                wanted = f"({arrays['t'].size},)" if arrays["t"].ndim == 1 else "one dimension"
                raise ValueError(f"{self._what}: {name} has the shape {values.shape}, not {wanted} like the times")
        if arrays["t"].size < 2:
            raise ValueError(f"{self._what}: {arrays['t'].size} samples; at least two are needed")

    def _check_times(self, t: Floats) -> None:
        if not np.isfinite(t).all():
            raise ValueError(f"{self._what}: the time of sample {_first(~np.isfinite(t))} is not finite")
        if not (np.diff(t) > 0).all():
            k = _first(np.diff(t) <= 0)
            raise ValueError(f"{self._what}: times must increase, but after sample {k} at {t[k]} s comes {t[k + 1]} s")


def _fixed(array: _Array) -> _Array:
    """The array that cannot be changed: itself if nothing can change it, so that records share it; else a copy."""
    if array.flags.writeable or not array.flags.c_contiguous:
        array = array.copy()
        array.setflags(write=False)
    return array


def _first(where: Bools) -> int:
    return int(np.argmax(where))


def top_speed(records: Sequence[Record]) -> float:
    """The speed of records that is rarely exceeded [rad/s]."""
    speeds = []
    for record in records:
        t, y = record.t[record.measured], record.y[record.measured]
        # Over several samples, so that noise of an angle does not count as speed.
        step = min(_SPEED_STEP, len(t) - 1)
        speeds.append(abs((y[step:] - y[:-step]) / (t[step:] - t[:-step])) if record.quantity == "angle" else abs(y))
    return float(np.quantile(np.concatenate(speeds), _RARELY))
