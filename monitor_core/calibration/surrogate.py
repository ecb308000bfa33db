"""Healthy records without end: the motion of a record, its innovations in another order, through the monitor itself.

Residual bootstrap (Kreiss and Lahiri 2012) in blocks of the innovations: their colour within a block stays.  What the
recursion makes of them, its autocorrelation, the unequal tails, is its own, as the very recursion runs.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from monitor_core.bank import Bank
from monitor_core.calibration.healthy import Samples, untested
from monitor_core.calibration.plants import Plants, innovations
from monitor_core.kernel.excursions import excursions
from monitor_core.kernel.tables import Floats
from monitor_core.model import AxisModel
from monitor_core.monitor import AxisMonitor
from monitor_core.settings import Settings

SAMPLES = 8_000_000
"""That are simulated, in all."""
LANES = 64
CHUNK = 4000
BLOCK = 2.0
"""Memories in a block of innovations."""
SETTLED = 3
"""Memories until the deviations have forgotten their start."""
BINS = 50
"""In a memory: of so many samples one is looked at."""
LEAST = 0.5
"""Excursions above that are kept, in sigma times memory."""
_ROOM, _KNOWN = 300_000, 50


@dataclass(frozen=True)
class Excursions:
    """Largest values of the tests' sums in each excursion from zero, falling; [direction][parameter].

    In sizes times samples, of tests with nu over sigma = k (p,), over so many ``samples`` of each test.
    """

    k: Floats
    sigma: Floats
    mean: Floats
    """Of the deviation, in sizes (p,)"""
    largest: tuple[tuple[Floats, ...], ...]
    samples: float


def simulated(
    model: AxisModel,
    settings: Settings,
    records: Sequence[Samples],
    k: float,
    rng: np.random.Generator,
    samples: int = SAMPLES,
    progress: Callable[[float], None] = lambda _: None,
) -> Excursions:
    """Excursions of the tests' sums with nu = k sigma, so many samples long.

    Raises:
        ValueError: no record has innovations.
    """
    watch = _Watch(model, settings, k)
    sources = [source for one in records if (source := source_of(model, settings, one)) is not None]
    if not sources:
        raise ValueError("nothing was learned from any record")
    whole = sum(len(source.u) for source in sources)
    # Of the first memories sigma is had; short records go by for it a first time.
    least = 1 if whole > 4 * _KNOWN * settings.memory else 2
    turns = max(least, round(samples / whole / LANES))
    for turn in range(turns):
        for source in sources:
            _run(model, settings, source, watch, rng)
        progress((turn + 1) / turns)
    return watch.found()


@dataclass(frozen=True)
class Source:
    """Of a record: what its copies need, from where the estimates run on."""

    u: Floats
    eps: Floats
    x: Floats
    u_before: float
    column: tuple[Floats, np.ndarray]
    t_us: int


def source_of(model: AxisModel, settings: Settings, one: Samples) -> Source | None:
    """What copies of a record need; None where too little was learned from it."""
    monitor, start = AxisMonitor.alone(model, untested(settings)), 0
    step = settings.span
    st = monitor.bank.state
    for start in range(0, len(one.t_us), step):
        if start and st.t[0] >= st.settled[0] and not st.seed_left[0]:
            break
        part = one.part(start, start + step)
        monitor.run(part.t_us, part.u, part.y, part.shift, part.gate)
    found = innovations(model, settings, one, (start,))
    eps = found.eps[start:]
    eps = eps[np.isfinite(eps)]
    if len(eps) < 2 * settings.memory:
        return None
    column, t_us = monitor.bank.column(0), int(st.t[0])
    return Source(one.u[start:], eps - eps.mean(), found.x[0], float(one.u[start - 1]), column, t_us)


def _run(model: AxisModel, settings: Settings, of: Source, watch: "_Watch", rng: np.random.Generator) -> None:
    """LANES copies of a record."""
    bank = watch.bank
    for a in range(LANES):
        bank.restore(a, *of.column)
    watch.begin()
    for t_us, u, y in copies_of(model, settings, of, rng):
        watch.take(np.repeat(t_us[:, np.newaxis], LANES, axis=1), u, y)


def copies_of(
    model: AxisModel, settings: Settings, of: Source, rng: np.random.Generator
) -> Iterator[tuple[np.ndarray, Floats, Floats]]:
    """LANES copies of a record in chunks, at equal intervals: t_us (N,), u and y (N, LANES)."""
    plants = Plants(model, settings, [model.nominal])
    which = np.zeros(LANES, np.int64)
    # From the sample before, whose torque acts up to the first.
    before = np.full((1, LANES), of.u_before)
    start = np.repeat(of.x[np.newaxis], LANES, axis=0)
    _, x = plants.run(which, start, before[0], before, np.zeros((1, LANES)))
    step, N = round(settings.interval_s * 1e6), len(of.u)
    draw = _Draw(of.eps, max(1, round(BLOCK * settings.memory)), rng)
    for k in range(0, N, CHUNK):
        u = np.repeat(of.u[k : k + CHUNK, np.newaxis], LANES, axis=1)
        y, x = plants.run(which, x, before[0], u, draw.take(len(u)))
        before = u[-1:]
        t_us = of.t_us + step * np.arange(k + 1, k + 1 + len(u), dtype=np.int64)
        yield t_us, u, y


class _Draw:
    """Innovations (N, LANES) in blocks that begin anywhere."""

    def __init__(self, eps: Floats, length: int, rng: np.random.Generator) -> None:
        self._eps, self._length, self._rng = eps, min(length, len(eps)), rng
        self._left = np.zeros((0, LANES))

    def take(self, count: int) -> Floats:
        while len(self._left) < count:
            first = self._rng.integers(0, len(self._eps) - self._length + 1, LANES)
            more = self._eps[first + np.arange(self._length)[:, np.newaxis]]
            self._left = np.concatenate([self._left, more])
        out, self._left = self._left[:count], self._left[count:]
        return out


class _Watch:
    """The monitors of all copies, and how far the sums of their tests go."""

    def __init__(self, model: AxisModel, settings: Settings, k: float) -> None:
        p = len(model.scale)
        self.bank = Bank([model] * LANES, [untested(settings)] * LANES)
        self._model, self._settings, self._k = model, settings, k
        self._q = max(1, round(settings.memory / BINS))
        self._g, self._top = np.zeros((2, p, LANES)), np.zeros((2, p, LANES))
        self._largest, self._found = np.zeros((2, p, _ROOM)), np.zeros((2, p), np.int64)
        self._sums, self._counted, self._tested = np.zeros((3, p)), 0, 0
        self._alpha1: Floats | None = None
        self._since, self._begun = 0, 0

    def begin(self) -> None:
        """Of other copies."""
        self._since = 0
        self._begun += 1
        self._g[...] = self._top[...] = 0.0

    def take(self, t_us: np.ndarray, u: Floats, y: Floats) -> None:
        """Samples (N, LANES)."""
        _, trace = self.bank.run_traced(t_us, u, y)
        scale, q = self._model.scale[:, np.newaxis], self._q
        first = max(0, round(SETTLED * self._settings.memory) - self._since)
        self._since += len(u)
        here = slice(first + q - 1, None, q)
        d = np.ascontiguousarray((trace.theta[here] - self._model.theta0[:, np.newaxis]) / scale)
        s = np.sqrt(self._settings.lam0 * trace.P[here]) / scale
        if not len(d):
            return
        self._sums += [d.sum(axis=(0, 2)), (d * d).sum(axis=(0, 2)), s.sum(axis=(0, 2))]
        self._counted += len(d) * LANES
        if self._alpha1 is None:
            if self._counted * q < _KNOWN * self._settings.memory * LANES and self._begun < 2:
                return  # first sigma is to be known
            self._alpha1 = self._k * self._sigma() / (self._sums[2] / self._counted)
        least = LEAST * self._sigma() * self._settings.memory / q
        excursions(d, s * self._alpha1[:, np.newaxis], self._g, self._top, least, self._largest, self._found)
        self._tested += len(d) * LANES

    def _sigma(self) -> Floats:
        mean = self._sums[0] / self._counted
        return np.asarray(np.sqrt(self._sums[1] / self._counted - mean**2))

    def found(self) -> Excursions:
        """All that was found."""
        assert self._alpha1 is not None
        kept = tuple(
            tuple(self._q * np.sort(row[: min(n, _ROOM)])[::-1] for row, n in zip(rows, ns, strict=True))
            for rows, ns in zip(self._largest, self._found, strict=True)
        )
        nu = self._alpha1 * self._sums[2] / self._counted
        mean = self._sums[0] / self._counted
        return Excursions(nu / self._sigma(), self._sigma(), mean, kept, float(self._tested * self._q))
