"""A fleet: axes of any drives, sample rates and settings, their blocks of samples taken in one call."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Floats
from monitor_core.detection.detector_protocol import DetectorName
from monitor_core.detection.multimodel.multimodel_detector import MultiModelDetector
from monitor_core.drive.axis_model import AxisModel
from monitor_core.kernel.block import Trace
from monitor_core.kernel.hypotheses import BankTrace
from monitor_core.monitoring.axis_batch import AxisBatch
from monitor_core.monitoring.axis_monitor import AnyEvent, AxisMonitor
from monitor_core.settings import Settings

_T = TypeVar("_T", bound=np.generic)


class Block(NamedTuple):
    """Samples of one axis, in the order of their receipt."""

    t_us: NDArray[np.int64]  # (N,) us
    u: Floats  # (N,) motor torque, N m
    y: Floats  # (N,) motor speed, rad/s, or motor angle, rad
    shift: Floats | None = None  # (N, p) theta_0(s) - theta_0, as for AxisBatch.run; None: what it was last
    gate: NDArray[np.bool_] | None = None  # (N,) where False nothing is learned; None: everywhere it is


_NOTHING: Mapping[int, Any] = MappingProxyType({})
Seen = Callable[[int, Trace], None]
"""Is told, of each axis that took samples, what the recursion did at each of them; axis dropped from the fields."""
SeenBeside = Callable[[int, BankTrace], None]
"""Is told, of each axis with a bank of hypotheses that took samples, what that did at each of them."""


class Fleet:
    """Monitors of axes; those of equal drive and equal monitored parameters share a bank, and so the kernel's lanes.

    ``monitors`` are in the order of the axes.  ``beside`` are the second detectors of axes that have one, ``alarms``
    says which detector of an axis alarms; default the CUSUM tests.

    Raises:
        ValueError: models and settings of different number, none, or settings that do not fit the drive.
    """

    def __init__(
        self,
        models: Sequence[AxisModel],
        settings: Sequence[Settings],
        beside: Mapping[int, MultiModelDetector] = _NOTHING,
        alarms: Mapping[int, DetectorName] = _NOTHING,
    ) -> None:
        if not models or len(models) != len(settings):
            raise ValueError(
                f"{len(models)} models and {len(settings)} settings: need one each, at least one"
            )
        self._groups = [
            _Group(axes, AxisBatch([models[a] for a in axes], [settings[a] for a in axes]))
            for axes in _alike(models, settings)
        ]
        placed = {axis: (group.bank, lane) for group in self._groups for lane, axis in enumerate(group.axes)}
        self.monitors = tuple(
            AxisMonitor.of_lane(*placed[axis], beside.get(axis), alarms.get(axis, "cusum"))
            for axis in range(len(models))
        )

    @property
    def bank_sizes(self) -> list[int]:
        """How many axes share each bank."""
        return [len(group.axes) for group in self._groups]

    def run(
        self, blocks: Mapping[int, Block], seen: Seen | None = None, seen_beside: SeenBeside | None = None
    ) -> list[tuple[int, AnyEvent]]:
        """Let axes take their blocks, of any lengths; an axis without one takes no sample.

        ``seen`` and ``seen_beside`` cost memory for every sample of the blocks: let them be short.

        Returns the events with the index of their axis, axis by axis, those of each detector in order of time.  Each
        axis does exactly what it would do alone.

        Raises:
            ValueError: an axis that does not exist, or arrays that do not fit; no axis has taken a sample then.
        """
        unknown = sorted(set(blocks) - set(range(len(self.monitors))))
        if unknown:
            raise ValueError(f"blocks for the axes {unknown}: there are {len(self.monitors)}, from 0 on")
        for axis, block in blocks.items():
            _check(axis, block, self.monitors[axis].model)
        events: list[tuple[int, AnyEvent]] = [
            event for group in self._groups for event in group.run(blocks, seen)
        ]
        for axis, block in blocks.items():
            beside = self.monitors[axis].beside
            of = block.t_us, block.u, block.y, block.gate, block.shift
            if beside is not None and seen_beside is None:
                events += [(axis, event) for event in beside.run(*of)]
            elif beside is not None and seen_beside is not None:
                said, trace = beside.run_traced(*of)
                seen_beside(axis, trace)
                events += [(axis, event) for event in said]
        return sorted(events, key=lambda pair: pair[0])


class _Group(NamedTuple):
    """A bank and the axes of its lanes."""

    axes: Sequence[int]
    bank: AxisBatch

    def run(self, blocks: Mapping[int, Block], seen: Seen | None) -> Iterator[tuple[int, AnyEvent]]:
        taken = [(lane, blocks[axis]) for lane, axis in enumerate(self.axes) if axis in blocks]
        count = np.zeros(len(self.axes), np.int64)
        for lane, block in taken:
            count[lane] = len(block.t_us)
        shape = int(count.max()), len(self.axes)
        t_us, u, y = np.zeros(shape, np.int64), np.zeros(shape), np.zeros(shape)
        for lane, block in taken:
            n = count[lane]
            t_us[:n, lane], u[:n, lane], y[:n, lane] = block.t_us, block.u, block.y
        before = self.bank.state.shift
        shift = _filled(
            {lane: block.shift for lane, block in taken},
            lambda: np.repeat(before[np.newaxis], shape[0], axis=0),
        )
        gate = _filled({lane: block.gate for lane, block in taken}, lambda: np.ones(shape, np.bool_))
        if seen is None:
            events = self.bank.run(t_us, u, y, count, shift, gate)
        else:
            events, trace = self.bank.run_traced(t_us, u, y, count, shift, gate)
            for lane, _ in taken:
                seen(self.axes[lane], Trace(*(field[: count[lane], ..., lane] for field in trace)))
        for lane, event in events:
            yield self.axes[lane], event


def _filled(given: Mapping[int, NDArray[_T] | None], empty: Callable[[], NDArray[_T]]) -> NDArray[_T] | None:
    """The lanes' values (N, ..., W) in an array of what is without them; None, where no lane has any."""
    if all(values is None for values in given.values()):
        return None
    out = empty()
    for lane, values in given.items():
        if values is not None:
            out[: len(values), ..., lane] = values
    return out


def _alike(models: Sequence[AxisModel], settings: Sequence[Settings]) -> list[list[int]]:
    """Axes that can share a bank, each group in the order of the axes."""
    groups: dict[object, list[int]] = {}
    for axis, (model, s) in enumerate(zip(models, settings, strict=True)):
        groups.setdefault((model.drive, model.monitored, s.run_on), []).append(axis)
    return list(groups.values())


def _check(axis: int, block: Block, model: AxisModel) -> None:
    N = len(block.t_us)
    shapes = (N,), (N,), (N,), (N, len(model.monitored)), (N,)
    for name, values, wanted in zip(Block._fields, block, shapes, strict=True):
        if values is not None and np.shape(values) != wanted:
            raise ValueError(f"axis {axis}: {name} has the shape {np.shape(values)}: need {wanted}")
