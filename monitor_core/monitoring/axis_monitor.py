"""Monitor of one axis: samples in, status and alarms out."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Floats
from monitor_core.detection.alarm import Alarm, Crossing, Event, Evidence, Recovered
from monitor_core.detection.alarm_arrays import episodes_from_array, episodes_to_array
from monitor_core.detection.cusum.alarm_tracker import EpisodeBook
from monitor_core.detection.cusum.evidence_builder import HELD, INVALID
from monitor_core.detection.detector_protocol import Book, DetectorName
from monitor_core.detection.multimodel import multimodel_detector as hypotheses
from monitor_core.detection.multimodel.events import Event as BankEvent
from monitor_core.detection.multimodel.multimodel_detector import MultiModelDetector
from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.structure import Drive
from monitor_core.kernel.block import Trace
from monitor_core.kernel.state import COUNTERS, NEVER, SCHEMA, UNSEEN
from monitor_core.monitoring.axis_batch import AxisBatch, standard_deviation
from monitor_core.monitoring.axis_status import (
    AxisStatus,
    DetectorStatus,
    Observation,
    ParameterStatus,
    Status,
)
from monitor_core.monitoring.observability import confounded, untold
from monitor_core.settings import Settings
from monitor_core.trend.entries import Reading

_T = TypeVar("_T", bound=np.generic)
_PRIME = 2**127 - 1
_OBSERVATION = tuple(Observation)
_TRACKING = {
    Observation.OBSERVED: Status.TRACKING,
    Observation.WEAK: Status.WEAK,
    Observation.UNSEEN: Status.UNSEEN,
}
_OF_NO_STATE: dict[str, Any] = {
    "alpha1": 0.0,
    "alpha2": 1.0,
    "thresholds": (),
    "P0": (),
    "run_on": False,
    "outlier": 0.0,
    "widen": 0.0,
    "untold": (),
}
"""Settings that may change from one run to the next, and a saved state goes on."""
Arrays = dict[str, NDArray[np.generic]]
AnyEvent = Event | BankEvent
"""Of either detector."""


class AxisMonitor:
    """Estimates, tests and alarms of one axis.

    ``AxisMonitor(model, settings)`` monitors an axis alone.  Of many axes, each monitor is a view of one lane of an
    ``AxisBatch`` (``of_lane``).

    Args:
        model: nominal values and bounds.
        settings: predictor, forgetting, tests.
        beside: the second detector, if there is one.
        alarms: whose alarms are those of the axis.
    """

    def __init__(
        self,
        model: AxisModel,
        settings: Settings,
        beside: MultiModelDetector | None = None,
        alarms: DetectorName = "cusum",
    ) -> None:
        self._view(AxisBatch([model], [settings]), 0, beside, alarms)

    @classmethod
    def of_lane(
        cls,
        batch: AxisBatch,
        lane: int,
        beside: MultiModelDetector | None = None,
        alarms: DetectorName = "cusum",
    ) -> AxisMonitor:
        """The monitor of one axis of a batch."""
        monitor = cls.__new__(cls)
        monitor._view(batch, lane, beside, alarms)
        return monitor

    def _view(
        self, batch: AxisBatch, lane: int, beside: MultiModelDetector | None, alarms: DetectorName
    ) -> None:
        self.batch, self.lane, self.beside, self.alarms = batch, lane, beside, alarms
        if alarms == "bank" and beside is None:
            raise ValueError("the bank of hypotheses is to alarm, but there is none")
        self._cusum = EpisodeBook()
        self.alarmed_by: DetectorName = alarms
        """Whose alarms counted when the state was saved that it went on from"""

    def book_of(self, detector: DetectorName) -> Book[Any]:
        """The open alarms by one detector.

        Raises:
            ValueError: it does not run.
        """
        if detector == "cusum":
            return self._cusum
        if self.beside is None:
            raise ValueError("there is no bank of hypotheses")
        return self.beside.book

    @property
    def book(self) -> Book[Any]:
        """The open alarms of the axis: those by the detector that alarms."""
        return self.book_of(self.alarms)

    @property
    def detectors(self) -> tuple[DetectorName, ...]:
        """Those that run."""
        return ("cusum",) if self.beside is None else ("cusum", "bank")

    @property
    def causes(self) -> tuple[str, ...]:
        """Whatever an alarm of the axis may name."""
        return self.beside.causes if self.alarms == "bank" and self.beside else self.model.monitored

    def adopt(self, open_alarms: Iterable[Alarm]) -> None:
        """Have these open alarms and no others."""
        episodes = list(open_alarms)
        if self.alarms == "bank" and self.beside is not None:
            self.beside.adopt(episodes)
            return
        counted = {e.parameter for e in self._cusum.open}
        self._cusum = EpisodeBook(episodes)
        for e in self._cusum.open:
            if e.parameter not in counted:
                # The calm that ends an episode is noted once: let it be counted from here.
                self.batch.state.calm[self.model.monitored.index(e.parameter), self.lane] = 0

    @property
    def model(self) -> AxisModel:
        """The model of this axis."""
        return self.batch.models[self.lane]

    @property
    def settings(self) -> Settings:
        """The settings of this axis."""
        return self.batch.settings[self.lane]

    @property
    def key(self) -> str:
        """What a saved state belongs to: schema, model, predictor.  Equal text, interchangeable states.

        A user's drive may change and keep its name, so its structure is part of it.
        """
        s = replace(self.settings, max_gap_s=self.settings.interval_s, **_OF_NO_STATE)
        m = self.model
        nominal = sorted(m.nominal.items())
        drive = f"{m.drive.name}/{m.drive.output}/{_fingerprint(m.drive):x}"
        units = " relative" if m.relative else ""
        return f"schema={SCHEMA} drive={drive} {nominal} theta={m.monitored}{units} {s}"

    @property
    def history_key(self) -> str:
        """What a slow history belongs to: other nominal values or another predictor would move it, a memory not."""
        s, m = self.settings, self.model
        drive = f"{m.drive.name}/{m.drive.output}/{_fingerprint(m.drive):x}"
        # "None" stood for a second output once: with it the histories of earlier versions go on.
        predictor = f"K={s.K} delay={s.delay_s} speed_scale={s.speed_scale} None"
        return f"drive={drive} {sorted(m.nominal.items())} {predictor}"

    def run(
        self,
        t_us: NDArray[np.int64],
        u: Floats,
        y: Floats,
        shift: Floats | None = None,
        gate: NDArray[np.bool_] | None = None,
    ) -> list[Alarm]:
        """Run samples (N,) of a monitor that is alone; returns the episodes raised, updated or ended.

        ``shift`` (N, p) and ``gate`` (N,) as for ``AxisBatch.run``.
        """
        block = _column(t_us), _column(u), _column(y)
        events = self.batch.run(*block, shift=_optional(shift), gate=_optional(gate))
        said: list[AnyEvent] = [event for _, event in events]
        if self.beside is not None:
            said += self.beside.run(t_us, u, y, gate, shift)
        return [episode for event in said for episode in self.apply(event)]

    def run_traced(
        self,
        t_us: NDArray[np.int64],
        u: Floats,
        y: Floats,
        shift: Floats | None = None,
        gate: NDArray[np.bool_] | None = None,
    ) -> tuple[list[Alarm], Trace]:
        """As ``run``, with the recursion's values at every sample, axis dropped: theta (N, p), g (N, 2, p), .."""
        block = _column(t_us), _column(u), _column(y)
        events, trace = self.batch.run_traced(*block, shift=_optional(shift), gate=_optional(gate))
        episodes = [episode for _, event in events for episode in self.apply(event)]
        return episodes, Trace(*(field[..., 0] for field in trace))

    def apply(self, event: AnyEvent) -> list[Alarm]:
        """Take an event of this axis into the book of its detector; returns the alarms that it changed.

        Those are the episodes raised, updated or ended by the detector that alarms.  Readings are for the slow
        history, which is kept elsewhere.
        """
        if isinstance(event, Reading):
            return []
        of: DetectorName = "cusum" if isinstance(event, Crossing | Recovered | Evidence) else "bank"
        episodes = self.book_of(of).apply(event)
        return episodes if of == self.alarms else []

    def start_from(self, theta: Floats) -> None:
        """Let the recursion start from another theta (p,) than the nominal one."""
        self.batch.state.theta[:, self.lane] = theta

    def status(self) -> AxisStatus:
        """All that is known now."""
        st, a = self.batch.state, self.lane
        last = int(st.t[a])
        return AxisStatus(
            time_us=None if last == NEVER else last,
            parameters=tuple(self._parameter(i) for i in range(len(self.model.monitored))),
            innovation_variance=float(st.lam0_running[a]),
            confounded=self._confounded(),
            counters={name: int(count) for name, count in self._counts()},
            detectors=tuple(self._detector(name) for name in self.detectors),
        )

    def _detector(self, name: DetectorName) -> DetectorStatus:
        cause, share = self._leading() if name == "cusum" or self.beside is None else self.beside.leading()
        names = tuple(dict.fromkeys(e.parameter for e in self.book_of(name).open))
        return DetectorStatus(name, name == self.alarms, cause, share, names)

    def _leading(self) -> tuple[str, float]:
        """The parameter of the CUSUM test that is nearest its threshold, and g over h."""
        share = self.batch.state.g[:, :, self.lane].max(axis=0) / self.batch.thresholds[:, self.lane]
        i = int(share.argmax())
        return self.model.monitored[i], float(share[i])

    def _counts(self) -> Iterator[tuple[str, int]]:
        st, a = self.batch.state, self.lane
        yield from zip(COUNTERS, st.counts[:, a], strict=True)

    def _parameter(self, i: int) -> ParameterStatus:
        st, a, parameter = self.batch.state, self.lane, self.model.parameters[i]
        P_ii, unseen = float(st.P[i, i, a]), st.observed[i, a] == UNSEEN
        return ParameterStatus(
            name=parameter.name,
            unit=parameter.unit,
            meaning=parameter.meaning,
            nominal=float(self.model.theta0[i] + st.shift[i, a]),
            estimate=math.nan
            if self._is_invalid(i)
            else float((st.theta_seen if unseen else st.theta)[i, a]),
            standard_deviation=standard_deviation(self.settings, P_ii),
            p_diagonal=P_ii,
            g_up=float(st.g[0, i, a]),
            g_down=float(st.g[1, i, a]),
            h=float(self.batch.thresholds[i, a]),
            nu=self._nu(i, P_ii),
            status=self._status(i),
            observation=_OBSERVATION[st.observed[i, a]],
        )

    def _nu(self, i: int, P_ii: float) -> float:
        alpha1, _, allowance = self.settings.tests(len(self.model.scale))[:, i]
        return float(alpha1 * math.sqrt(self.settings.lam0 * P_ii) + allowance * self.model.scale[i])

    def _confounded(self) -> tuple[str, ...]:
        st, a = self.batch.state, self.lane
        doubts = untold(self.settings.untold)
        if not st.starved[a] or st.seed_left[a]:  # without P(0) there is nothing to compare P with
            return doubts
        return doubts + confounded(st.P[:, :, a], st.P_nom[:, a], self.model.scale, self.model.monitored)

    def _is_invalid(self, i: int) -> bool:
        """Its bounds hold it, or the model no longer explains what is measured."""
        st, a, (lower, upper) = self.batch.state, self.lane, self.batch.limits
        theta0, theta = self.model.theta0[i] + st.shift[i, a], st.theta[i, a]
        bound = upper[i, a] if theta > theta0 else lower[i, a]
        held = bool(abs(theta - bound) <= HELD * abs(theta0 - bound))
        running = st.lam0_running[a]
        return held or bool(running > INVALID * self.settings.lam0)

    def _status(self, i: int) -> Status:
        st, a = self.batch.state, self.lane
        if self.book.is_open(self.model.parameters[i].name):
            return Status.ALARM
        if st.t[a] == NEVER:
            return Status.WAITING
        if st.t[a] < st.settled[a]:
            return Status.SETTLING
        if st.seed_left[a] > 0:
            return Status.SEEDING
        if self._is_invalid(i):
            return Status.INVALID
        return _TRACKING[_OBSERVATION[st.observed[i, a]]]

    @property
    def beside_key(self) -> str:
        """What a saved state of the second detector belongs to."""
        return f"bank schema={hypotheses.SCHEMA} {self.key}"

    def to_arrays(self) -> Arrays:
        """The whole state but that of the second detector, to be saved: arrays by name."""
        floats, ints = self.batch.column(self.lane)
        return {
            "floats": floats,
            "ints": ints,
            "episodes": episodes_to_array(self._cusum.open),
            "alarms": np.array([self.alarms == "bank"]),
        }

    def from_arrays(self, arrays: Arrays) -> None:
        """Go on from a saved state.

        Raises:
            KeyError: an array is missing.
            ValueError: it does not belong to this model, or is damaged.
        """
        episodes = episodes_from_array(arrays["episodes"], self.model.monitored)
        by_bank = bool(np.asarray(arrays.get("alarms", False)).any())
        self.batch.restore(
            self.lane, np.asarray(arrays["floats"], float), np.asarray(arrays["ints"], np.int64)
        )
        self._cusum = EpisodeBook(episodes)
        self.alarmed_by = "bank" if by_bank else "cusum"


def _fingerprint(drive: Drive) -> int:
    """Of all that the kernel sees of a drive's structure; the same in every process."""
    seen = ([state.name for state in drive.states], drive.inputs, drive.terms, drive.speed_state)
    return int.from_bytes(repr(seen).encode(), "big") % _PRIME


def _column(values: NDArray[_T]) -> NDArray[_T]:
    return np.asarray(values)[..., np.newaxis]


def _optional(values: NDArray[_T] | None) -> NDArray[_T] | None:
    return None if values is None else _column(values)
