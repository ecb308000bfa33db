"""Monitor of one axis: samples in, status and alarms out."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Floats
from monitor_core.detection.alarm import Alarm, DetectorName, alarms_from_array, alarms_to_array
from monitor_core.detection.cusum.cusum_detector import CusumDetector
from monitor_core.detection.cusum.cusum_evidence import HELD, INVALID, BatchEvent
from monitor_core.detection.multimodel.multimodel_detector import SCHEMA as MULTIMODEL_SCHEMA
from monitor_core.detection.multimodel.multimodel_detector import MultiModelDetector
from monitor_core.detection.multimodel.naming import Event as MultiModelEvent
from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.structure import Drive
from monitor_core.kernel.admission import GATED, IDLE
from monitor_core.kernel.block import Trace
from monitor_core.kernel.hypotheses import BankTrace
from monitor_core.kernel.state import COUNTERS, NEVER, SCHEMA, SEEDING, UNSEEN, USED
from monitor_core.monitoring.alarm_tracker import REOPEN_MEMORIES, AlarmChange, AlarmTracker
from monitor_core.monitoring.axis_batch import AxisBatch, standard_deviation
from monitor_core.monitoring.axis_status import (
    AxisStatus,
    DetectorStatus,
    Observation,
    ParameterStatus,
    Status,
    confounded,
    unidentifiable_words,
)
from monitor_core.monitoring.not_tested import NotTested, Remedy, remedy
from monitor_core.monitoring.recommended_settings import time_constant
from monitor_core.samples import SampleBlock
from monitor_core.settings import Settings
from monitor_core.trend.entries import Reading

_PRIME = 2**127 - 1
_OBSERVATION = tuple(Observation)
_TRACKING = {
    Observation.OBSERVED: Status.TRACKING,
    Observation.WEAK: Status.WEAK,
    Observation.UNSEEN: Status.UNSEEN,
}
_NOT_PART_OF_STATE: dict[str, Any] = {
    "alpha1": 0.0,
    "alpha2": 1.0,
    "thresholds": (),
    "model_error": (),
    "P0": (),
    "run_on": False,
    "outlier_limit": 0.0,
    "covariance_reset": 0.0,
    "unidentifiable": (),
}
"""Settings that may change between two runs without making a saved state invalid."""
Arrays = dict[str, NDArray[np.generic]]


class Deviations(NamedTuple):
    """What estimates show: theta - theta_0(s) (p,), NaN where not observed, and its covariance (p, p)."""

    d: Floats
    covariance: Floats
    tolerated: Floats
    """nu (p,): deviation per sample that the tests tolerate"""
    allowance: Floats
    """(p,) what healthy records differ by"""


class AxisMonitor:
    """Estimates, tests and alarms of one axis.

    ``AxisMonitor(model, settings)`` monitors an axis alone: ``changes = monitor.update(samples)``,
    ``monitor.status()``.
    Of many axes, each monitor is a view of one lane of an ``AxisBatch`` (``of_lane``); see ``Fleet``.

    Args:
        model: nominal values and bounds.
        settings: predictor, forgetting, tests.
        multimodel: the multi-model detector; None: it does not run.
        alarm_source: the detector whose alarms are those of the axis; the other one runs in shadow mode.

    Raises:
        ValueError: settings that do not fit the drive; alarms of a detector that does not run.
    """

    def __init__(
        self,
        model: AxisModel,
        settings: Settings,
        multimodel: MultiModelDetector | None = None,
        alarm_source: DetectorName = "cusum",
    ) -> None:
        self._view(AxisBatch([model], [settings]), 0, multimodel, alarm_source)

    @classmethod
    def of_lane(
        cls,
        batch: AxisBatch,
        lane: int,
        multimodel: MultiModelDetector | None = None,
        alarm_source: DetectorName = "cusum",
    ) -> AxisMonitor:
        """The monitor of one axis of a batch."""
        monitor = cls.__new__(cls)
        monitor._view(batch, lane, multimodel, alarm_source)
        return monitor

    def _view(
        self, batch: AxisBatch, lane: int, multimodel: MultiModelDetector | None, source: DetectorName
    ) -> None:
        if source == "multimodel" and multimodel is None:
            raise ValueError("the multi-model detector is the alarm source, but does not run")
        self.batch, self.lane, self.multimodel, self.alarm_source = batch, lane, multimodel, source
        self.cusum = CusumDetector(self.model.monitored, batch.state.g[:, :, lane], batch.thresholds[:, lane])
        self._tracker = AlarmTracker(reopen_us=self._reopen_us)
        self._alpha1: list[float] = self.settings.tests(len(self.model.scale))[0].tolist()
        self.look_alike: Mapping[str, str] = {}
        """What else a change of a parameter may be, for its alarms, by its name"""
        self._models_wait = False
        self._open_us = NEVER  # time of the last sample that no gate left out

    @property
    def open_alarms(self) -> tuple[Alarm, ...]:
        """The open alarms of the axis, the oldest first."""
        return self._tracker.open

    @property
    def causes(self) -> tuple[str, ...]:
        """Every cause that an alarm of the axis may name."""
        return self._source.causes

    @property
    def _reopen_us(self) -> int:
        s = self.settings
        return round(1e6 * REOPEN_MEMORIES * s.memory * s.interval_s)

    @property
    def _source(self) -> CusumDetector | MultiModelDetector:
        if self.alarm_source == "multimodel" and self.multimodel is not None:
            return self.multimodel
        return self.cusum

    def adopt(self, open_alarms: Iterable[Alarm], ended: Iterable[Alarm] = ()) -> None:
        """Replace the open alarms, as after a restart.

        ``ended``: alarms that have ended; one whose cause comes back soon is reopened.  Without them a change that was
        detected while such an alarm was open would be raised as a second one, from a time at which the first still was.
        """
        before = (*self._tracker.open, *self._tracker.unreported)
        self._tracker.adopt(open_alarms, ended)
        self._source.adopt((*self._tracker.open, *self._tracker.unreported), before)

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
        """Identity of a saved state: schema, model, predictor.  States with equal keys are interchangeable.

        A user's drive may change and keep its name, so its structure is part of the key.
        """
        s = replace(self.settings, max_gap_s=self.settings.interval_s, **_NOT_PART_OF_STATE)
        m = self.model
        return f"schema={SCHEMA} {_model_key(m)} theta={m.monitored} {s}"

    @property
    def history_key(self) -> str:
        """Identity of a slow history.

        Other nominal values or another predictor would move it, another memory would not.
        """
        s = self.settings
        # "None" is a former part of the key: it keeps the histories of earlier versions valid.
        predictor = f"K={s.K} delay={s.delay_s} speed_scale={s.speed_scale} None"
        return f"{_model_key(self.model)} {predictor}"

    def update(self, samples: SampleBlock) -> list[AlarmChange]:
        """Take samples (N,) of an axis that is monitored alone.

        Returns what became of its alarms: each alarm that was raised, renamed, updated or ended, once.

        Raises:
            ValueError: arrays of shapes that do not fit.
        """
        events = self.batch.run(*_columns(samples))
        return self.apply((event for _, event in events), self.multimodel_events(samples), samples)

    def update_traced(self, samples: SampleBlock) -> tuple[list[AlarmChange], Trace]:
        """As ``update``, with the values of the recursion at every sample: theta (N, p), g (N, 2, p), .."""
        events, trace = self.batch.run_traced(*_columns(samples))
        changes = self.apply((event for _, event in events), self.multimodel_events(samples), samples)
        return changes, Trace(*(field[..., 0] for field in trace))

    def update_multimodel(self, samples: SampleBlock) -> list[AlarmChange]:
        """Let only the multi-model detector take samples, as ``Fleet.update`` has left it out."""
        return self.apply(multimodel=self.multimodel_events(samples), samples=samples)

    def multimodel_events(self, samples: SampleBlock) -> Sequence[MultiModelEvent]:
        """The events of the multi-model detector in these samples, if it runs."""
        return self.multimodel.bank.run(*self.judged(samples)[:6]) if self.multimodel else ()

    def multimodel_events_traced(
        self, samples: SampleBlock
    ) -> tuple[Sequence[MultiModelEvent], BankTrace | None]:
        """As ``multimodel_events``, with the values of every hypothesis at every sample."""
        return self.multimodel.bank.run_traced(*self.judged(samples)[:6]) if self.multimodel else ((), None)

    def judged(self, samples: SampleBlock) -> SampleBlock:
        """The samples for the multi-model detector: with a closed gate while estimates are only made, or it waits."""
        if self.batch.judged[self.lane] and not self._models_wait:
            return samples
        return samples._replace(gate=np.zeros(samples.size, np.bool_))

    def judge(self, on: bool) -> None:
        """Whether estimates are tested from now on; otherwise they are only made."""
        self.batch.judge(self.lane, on)

    def allow(self, more: Floats, models_wait: bool) -> None:
        """Allow in the CUSUM tests for so much more (p,) than the settings do, until the next call.

        The allowance of the multi-model detector is that of its records: it may have to wait meanwhile.
        """
        self.batch.allow(self.lane, more)
        self._models_wait = models_wait

    @property
    def time_us(self) -> int | None:
        """Time of the last sample [us]; None before the first."""
        last = int(self.batch.state.t[self.lane])
        return None if last == NEVER else last

    @property
    def learned(self) -> int:
        """Number of samples from which theta has been updated."""
        return int(self.batch.state.counts[USED, self.lane])

    def deviations(self) -> Deviations | None:
        """What the estimates show now; None: P(0) is not found yet."""
        st, a = self.batch.state, self.lane
        if st.seed_left[a] or st.t[a] == NEVER:
            return None
        d = st.theta[:, a] - self.model.theta0 - st.shift[:, a]
        P = st.P[:, :, a]
        return Deviations(
            np.where(st.observed[:, a] == UNSEEN, math.nan, d),
            self.settings.lam0 * P / self.settings.divisor,
            np.array([self._nu(i, float(P[i, i])) for i in range(len(d))]),
            self.batch.allowance[:, a].copy(),
        )

    def move_nominal(self, step: Floats) -> None:
        """Move the nominal values by a step (p,) under the estimates, which stay."""
        self.batch.move_nominal(self.lane, step)

    def apply(
        self,
        cusum: Iterable[BatchEvent] = (),
        multimodel: Iterable[MultiModelEvent] = (),
        samples: SampleBlock | None = None,
    ) -> list[AlarmChange]:
        """Make alarms of the events of the alarm source, in order of time; events of the other detector are ignored.

        ``samples``: those of the events, which state whether the axis was in the conditions of its calibration.
        """
        if samples is not None:
            self._open_us = max(self._open_us, _last_open(samples))
        if self.alarm_source == "multimodel" and self.multimodel is not None:
            interpret = _marked(self.multimodel.interpret, samples)
            return self._tracker.update(multimodel, _with_alike(interpret, self.look_alike))
        found = (event for event in cusum if not isinstance(event, Reading))
        marked = _marked(self.cusum.interpret, samples)
        return self._tracker.update(found, _with_alike(marked, self.look_alike))

    def status(self) -> AxisStatus:
        """Status of the axis now."""
        st, a = self.batch.state, self.lane
        return AxisStatus(
            time_us=self.time_us,
            parameters=tuple(self._parameter(i) for i in range(len(self.model.monitored))),
            innovation_variance=float(st.lam0_running[a]),
            confounded=self._confounded(),
            counters=dict(zip(COUNTERS, map(int, st.counts[:, a]), strict=True)),
            detectors=tuple(self._detectors()),
            remedy=self._remedy(),
            memory_s=self._memory_s,
            covariance=tuple(
                map(tuple, (self.settings.lam0 / self.settings.divisor * st.P[..., a]).tolist())
            ),
        )

    def _detectors(self) -> Iterator[DetectorStatus]:
        for detector in (self.cusum, self.multimodel):
            if detector is not None:
                yield DetectorStatus(detector.name, detector.name == self.alarm_source, *detector.leading())

    def _parameter(self, i: int) -> ParameterStatus:
        st, a, parameter = self.batch.state, self.lane, self.model.parameters[i]
        P_ii, estimate = float(st.P[i, i, a]), st.theta_seen if st.observed[i, a] == UNSEEN else st.theta
        return ParameterStatus(
            name=parameter.name,
            unit=parameter.unit,
            meaning=parameter.meaning,
            nominal=float(self.model.theta0[i] + st.shift[i, a]),
            estimate=math.nan if self._is_invalid(i) else float(estimate[i, a]),
            standard_deviation=standard_deviation(self.settings, P_ii),
            p_diagonal=P_ii,
            g_up=float(st.g[0, i, a]),
            g_down=float(st.g[1, i, a]),
            h=float(self.batch.thresholds[i, a]),
            nu=self._nu(i, P_ii),
            status=self._status(i),
            observation=_OBSERVATION[st.observed[i, a]],
            not_tested=self._not_tested(i),
            tested_s=self._tested_samples(i) * self.settings.interval_s,
        )

    def _not_tested(self, i: int) -> NotTested | None:
        """Why the detector that alarms would not find a change of parameter i now; None: it would."""
        st, a, by_models = self.batch.state, self.lane, self.alarm_source == "multimodel"
        unseen, seeding = st.observed[i, a] == UNSEEN, not by_models and st.seed_left[a]
        again = seeding and st.counts[SEEDING, a] > self.settings.seed_updates - st.seed_left[a]
        blocked = again and (st.observed[:, a] == UNSEEN).any()
        reasons = {
            NotTested.NO_SAMPLE: st.t[a] == NEVER,
            NotTested.UNIDENTIFIABLE: self.settings.unidentifiable,
            NotTested.SETTLING: st.t[a] < st.settled[a],
            # For how long gates have left out all samples: a robot that rests between two motions is tested.
            NotTested.CONDITIONS: st.mode[a] == GATED
            and (int(st.t[a]) - self._open_us) * 1e-6 > self._memory_s,
            NotTested.WARM_UP: not self.batch.judged[a],
            NotTested.NOT_OBSERVED: unseen and (st.mode[a] == IDLE or not st.seed_left[a]),
            NotTested.UNCERTAIN: (again and unseen) or (not seeding and self._is_uncertain(i)),
            NotTested.BLOCKED: blocked,
            NotTested.SEEDING: seeding,
            NotTested.NO_THRESHOLD: by_models and self.model.monitored[i] not in self._tested_causes,
        }
        return next((reason for reason, holds in reasons.items() if holds), None)

    @property
    def _memory_s(self) -> float:
        return self.settings.memory * self.settings.interval_s

    def _is_uncertain(self, i: int) -> bool:
        """Whether the CUSUM tests could not find a change of parameter i by its whole size, as commissioned or now."""
        st, a = self.batch.state, self.lane
        nu = self._nu(i, min(st.P_nom[i, a], st.P[i, i, a]))
        return self.alarm_source == "cusum" and nu >= self.model.scale[i]

    def _tested_samples(self, i: int) -> int:
        if self.alarm_source == "multimodel" and self.multimodel is not None:
            tested = self.model.monitored[i] in self._tested_causes and self.multimodel.made
            return self.multimodel.bank.tested_samples if tested else 0
        return int(self.batch.state.tested[i, self.lane])

    @property
    def _tested_causes(self) -> frozenset[str]:
        """Causes that the multi-model detector has a threshold for; before its first sample: every one."""
        if self.multimodel is None or not self.multimodel.made:
            return frozenset(self.model.monitored)
        return frozenset(self.multimodel.bank.causes)

    def _remedy(self) -> Remedy | None:
        seed_left, counts = int(self.batch.state.seed_left[self.lane]), self.batch.state.counts[:, self.lane]
        if not seed_left or self.alarm_source == "multimodel":
            return None
        return remedy(self._slowest_s, self.settings, seed_left, int(counts[SEEDING] + counts[USED]))

    @cached_property
    def _slowest_s(self) -> float:
        """Slowest time constant of the predictor; to find it takes longer than all else of a status."""
        return time_constant(self.model, self.settings.interval_s, self.settings.K)

    def _nu(self, i: int, P_ii: float) -> float:
        return self._alpha1[i] * math.sqrt(self.settings.lam0 * P_ii) + float(
            self.batch.allowance[i, self.lane]
        )

    def _confounded(self) -> tuple[str, ...]:
        st, a = self.batch.state, self.lane
        doubts = unidentifiable_words(self.settings.unidentifiable)
        if not st.unobserved[a] or st.seed_left[a]:  # without P(0) there is nothing to compare P with
            return doubts
        return doubts + confounded(st.P[:, :, a], st.P_nom[:, a], self.model.scale, self.model.monitored)

    def _is_invalid(self, i: int) -> bool:
        """Whether a bound holds the estimate, or the model no longer explains the measurements."""
        st, a, (lower, upper) = self.batch.state, self.lane, self.batch.limits
        theta0, theta = self.model.theta0[i] + st.shift[i, a], st.theta[i, a]
        bound = upper[i, a] if theta > theta0 else lower[i, a]
        held = bool(abs(theta - bound) <= HELD * abs(theta0 - bound))
        running = st.lam0_running[a]
        return held or bool(running > INVALID * self.settings.lam0)

    def _status(self, i: int) -> Status:
        st, a = self.batch.state, self.lane
        if self._tracker.is_open(self.model.parameters[i].name):
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
    def multimodel_key(self) -> str:
        """Identity of a saved state of the multi-model detector."""
        return f"multimodel schema={MULTIMODEL_SCHEMA} {self.key}"

    def to_arrays(self) -> Arrays:
        """The whole state except that of the multi-model detector, to be saved: arrays by name."""
        floats, ints = self.batch.column(self.lane)
        t = self._tracker
        alarms = {"alarms": (*t.ended, *t.open), "unreported": t.unreported}
        own = {"floats": floats, "ints": ints, "open_us": np.array([self._open_us], np.int64)}
        return own | {k: alarms_to_array(a) for k, a in alarms.items()}

    def from_arrays(self, arrays: Arrays) -> None:
        """Continue from a saved state; alarms of causes that the axis no longer has are left out.

        Raises:
            KeyError: an array is missing.
            ValueError: it does not belong to this model, or is damaged.
        """
        alarms, unreported = (
            alarms_from_array(arrays[name], self.causes) for name in ("alarms", "unreported")
        )
        opened = np.asarray(arrays.get("open_us", [NEVER]), np.int64)  # states of before do not have it
        if opened.shape != (1,):
            raise ValueError(f"open_us of shape {opened.shape} does not fit")
        self.batch.restore(
            self.lane, np.asarray(arrays["floats"], float), np.asarray(arrays["ints"], np.int64)
        )
        self._open_us = int(opened[0])
        self._tracker = AlarmTracker(alarms, unreported, self._reopen_us)


_E = TypeVar("_E")
_Interpret = Callable[[_E, Sequence[Alarm]], Iterable[Alarm]]


def _last_open(samples: SampleBlock) -> int:
    """Time of the last sample that no gate leaves out, and whose conditions are known [us]; NEVER: none."""
    if samples.gate is None and samples.shift is None:
        return int(samples.t_us[-1]) if samples.size else NEVER
    is_open = np.ones(samples.size, np.bool_) if samples.gate is None else samples.gate
    if samples.shift is not None:
        is_open = is_open & np.isfinite(samples.shift).all(axis=1)
    return int(samples.t_us[is_open][-1]) if is_open.any() else NEVER


def _marked(interpret: _Interpret[_E], samples: SampleBlock | None) -> _Interpret[_E]:
    """As ``interpret``; a new alarm states whether it was raised in the conditions of the calibration."""
    if samples is None or samples.inside is None:
        return interpret
    t_us, inside = samples.t_us, samples.inside

    def marked(event: _E, open_alarms: Sequence[Alarm]) -> Iterator[Alarm]:
        known = {alarm.key for alarm in open_alarms}
        for alarm in interpret(event, open_alarms):
            if alarm.key in known or alarm.inside_calibration is not None:
                yield alarm
            else:
                at = np.flatnonzero(t_us == alarm.raised_us)
                yield replace(alarm, inside_calibration=bool(inside[at[0]]) if at.size else None)

    return marked


def _with_alike(interpret: _Interpret[_E], look_alike: Mapping[str, str]) -> _Interpret[_E]:
    """As ``interpret``; causes state what else they may be."""
    if not look_alike:
        return interpret

    def stated(event: _E, open_alarms: Sequence[Alarm]) -> Iterator[Alarm]:
        for alarm in interpret(event, open_alarms):
            causes = (
                cause._replace(alike=(*cause.alike, look_alike[cause.parameter]))
                if cause.parameter in look_alike and look_alike[cause.parameter] not in cause.alike
                else cause
                for cause in alarm.causes
            )
            yield replace(alarm, causes=tuple(causes))

    return stated


def _model_key(model: AxisModel) -> str:
    drive = model.drive
    name = f"{drive.name}/{drive.output}/{_fingerprint(drive):x}"
    return f"drive={name} {sorted(model.nominal.items())}"


def _fingerprint(drive: Drive) -> int:
    """Hash of all that the kernel sees of the structure of a drive; the same in every process."""
    seen = ([state.name for state in drive.states], drive.inputs, drive.terms, drive.speed_state)
    return int.from_bytes(repr(seen).encode(), "big") % _PRIME


def _columns(samples: SampleBlock) -> tuple[Any, ...]:
    """The arguments of ``AxisBatch.run`` for one axis: an axis last in every array."""
    t_us, u, y, *more = (None if values is None else values[..., np.newaxis] for values in samples[:6])
    return t_us, u, y, None, *more
