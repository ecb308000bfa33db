"""Monitor of one axis: samples in, status and alarms out."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from monitor_core.arrays import Arrays, Floats
from monitor_core.detection.alarm import Alarm, DetectorName, alarms_from_array, alarms_to_array
from monitor_core.detection.cusum.cusum_detector import CusumDetector
from monitor_core.detection.cusum.cusum_evidence import BatchEvent
from monitor_core.detection.multimodel.multimodel_detector import SCHEMA as MULTIMODEL_SCHEMA
from monitor_core.detection.multimodel.multimodel_detector import MultiModelDetector
from monitor_core.detection.multimodel.naming import Event as MultiModelEvent
from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.structure import Drive
from monitor_core.kernel.block import Trace
from monitor_core.kernel.hypotheses import BankTrace
from monitor_core.kernel.state import NEVER, SCHEMA, SEEDING, USED
from monitor_core.monitoring.alarm_tracker import (
    REOPEN_MEMORIES,
    AlarmChange,
    AlarmTracker,
    LookAlike,
    in_context,
    last_open_us,
    no_other_causes,
    reopen_s,
)
from monitor_core.monitoring.axis_batch import AxisBatch
from monitor_core.monitoring.axis_status import AxisStatus, DetectorStatus
from monitor_core.monitoring.lane_status import Deviations, LaneStatus
from monitor_core.samples import SampleBlock
from monitor_core.settings import Settings
from monitor_core.trend.entries import EstimateReading

_PRIME = 2**127 - 1
_SETTINGS_KEY = (
    "Settings(interval_s={0.interval_s!r}, lam={0.lam!r}, lam0={0.lam0!r}, alpha1=0.0, alpha2=1.0, thresholds=(), "
    "model_error=(), K={0.K!r}, K_after={0.K_after!r}, delay_s={0.delay_s!r}, max_gap_s={0.interval_s!r}, "
    "settle_s={0.settle_s!r}, lost_s={0.lost_s!r}, speed_scale={0.speed_scale!r}, P0=(), "
    "information_floor={0.information_floor!r}, min_excitation={0.min_excitation!r}, outlier_limit=0.0, "
    "largest_error={0.largest_error!r}, joint_state={0.joint_state!r}, covariance_reset=0.0, unidentifiable=(), "
    "run_on=False)"
)
"""Settings in the key of a saved state, as the first version wrote them: with another text, an upgrade would lose the
checkpoints.  Settings with a fixed value here may change between two runs without making a saved state invalid."""


class AxisMonitor:
    """Estimates, tests and alarms of one axis.

    ``AxisMonitor(model, settings)`` monitors a single axis: ``changes = monitor.update(samples)``,
    ``monitor.status()``.
    With many axes, each monitor is a view of one lane of an ``AxisBatch`` (``of_lane``); see ``Fleet``.

    Args:
        model: nominal values and bounds.
        settings: predictor, forgetting, tests.
        multimodel: the multi-model detector; None: it does not run.
        alarm_source: the detector that raises the alarms of the axis; the other one runs in shadow mode.

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

    def _view(self, batch: AxisBatch, lane: int, multimodel: MultiModelDetector | None, source: DetectorName) -> None:
        if source == "multimodel" and multimodel is None:
            raise ValueError("the multi-model detector is the alarm source, but does not run")
        self.batch, self.lane, self.multimodel, self.alarm_source = batch, lane, multimodel, source
        self.cusum = CusumDetector(self.model.monitored, batch.state.g[:, :, lane], batch.thresholds[:, lane])
        self._tracker = AlarmTracker((), (), *self._reopen_us)
        self._status = LaneStatus(batch, lane, multimodel, source)
        self.look_alike: LookAlike = no_other_causes
        """Finds other possible causes of an alarm, which the alarm then names, too"""
        self.judged_us: int | None = None
        """Time [us] at which the heat, now unknown, will be known at the latest; None: not determined yet"""
        self.waits = False
        """Whether the tests wait until that time, as nothing shows the heat earlier"""
        self._models_wait = False
        self._open_us = NEVER  # time of the last sample that no gate left out
        self._judged_from = 0  # value of ``learned`` when the tests were last switched
        self._learned_unjudged = 0  # of the samples before that, those without tests

    @property
    def open_alarms(self) -> tuple[Alarm, ...]:
        """The open alarms of the axis, the oldest first."""
        return self._tracker.open

    @property
    def causes(self) -> tuple[str, ...]:
        """All causes that an alarm of the axis may name."""
        return self._source.causes

    @property
    def _reopen_us(self) -> tuple[int, int]:
        """Times after the end of an alarm in which it may be reopened, if it has a name, and if not."""
        memory_s = self.settings.memory * self.settings.interval_s
        return round(1e6 * REOPEN_MEMORIES * memory_s), round(1e6 * reopen_s(memory_s))

    @property
    def _source(self) -> CusumDetector | MultiModelDetector:
        if self.alarm_source == "multimodel" and self.multimodel is not None:
            return self.multimodel
        return self.cusum

    def adopt(self, open_alarms: Iterable[Alarm], ended: Iterable[Alarm] = ()) -> None:
        """Replace the open alarms, as after a restart.

        ``ended``: alarms that have ended; if the cause of one comes back soon, it is reopened.  Without them, a change
        that was detected while such an alarm was still open would be raised as a second alarm.
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
        """Key of a saved state: schema, model, predictor.  States with equal keys are interchangeable.

        A user may change a drive and keep its name, so the structure of the drive is part of the key.
        """
        m = self.model
        return f"schema={SCHEMA} {_model_key(m)} theta={m.monitored} {_SETTINGS_KEY.format(self.settings)}"

    @property
    def history_key(self) -> str:
        """Key of a slow history.

        Other nominal values or another predictor would shift the history, so they are part of the key; the memory is
        not.
        """
        s = self.settings
        # Earlier versions had "None" in the key; with it their histories stay valid.
        predictor = f"K={s.K} delay={s.delay_s} speed_scale={s.speed_scale} None"
        return f"{_model_key(self.model)} {predictor}"

    def update(self, samples: SampleBlock) -> list[AlarmChange]:
        """Take samples (N,) of an axis that is monitored alone.

        Returns the changes of its alarms: each alarm that was raised, renamed, updated, ended or reopened, once.

        Raises:
            ValueError: arrays of shapes that do not fit.
        """
        events = self.batch.run(**_columns(samples))
        return self.apply((event for _, event in events), self.multimodel_events(samples), samples)

    def update_traced(self, samples: SampleBlock) -> tuple[list[AlarmChange], Trace]:
        """As ``update``, with the values of the recursion at every sample: theta (N, p), g (N, 2, p), .."""
        events, trace = self.batch.run_traced(**_columns(samples))
        changes = self.apply((event for _, event in events), self.multimodel_events(samples), samples)
        return changes, Trace(*(field[..., 0] for field in trace))

    def update_multimodel(self, samples: SampleBlock) -> list[AlarmChange]:
        """Let only the multi-model detector take samples, after ``Fleet.update(.., multimodel=False)``."""
        return self.apply(multimodel=self.multimodel_events(samples), samples=samples)

    def multimodel_events(self, samples: SampleBlock) -> Sequence[MultiModelEvent]:
        """Run the multi-model detector on these samples; returns its events, or none if it does not run."""
        return self.multimodel.bank.run(self.judged(samples)) if self.multimodel else ()

    def multimodel_events_traced(self, samples: SampleBlock) -> tuple[Sequence[MultiModelEvent], BankTrace | None]:
        """As ``multimodel_events``, with the values of each hypothesis at each sample."""
        return self.multimodel.bank.run_traced(self.judged(samples)) if self.multimodel else ((), None)

    def judged(self, samples: SampleBlock) -> SampleBlock:
        """The samples for the multi-model detector: with a closed gate while the axis is not tested or it must wait."""
        if self.batch.judged[self.lane] and not self._models_wait:
            return samples
        return samples._replace(gate=np.zeros(samples.size, np.bool_))

    def judge(self, on: bool) -> None:
        """Switch the tests on or off from now on; the estimates are updated in any case."""
        if on != self.batch.judged[self.lane]:
            self._learned_unjudged, self._judged_from = self._unjudged(), self.learned
            self.batch.judge(self.lane, on)

    def _unjudged(self) -> int:
        """Number of samples since the start that have updated theta while the tests were switched off."""
        since = 0 if self.batch.judged[self.lane] else self.learned - self._judged_from
        return self._learned_unjudged + since

    def allow(self, more: Floats, models_wait: bool) -> None:
        """Set an additional allowance (p,) for the CUSUM tests, beyond that of the settings, until the next call.

        The multi-model detector has a fixed allowance from its records; ``models_wait`` makes it wait meanwhile.
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
        """Number of samples that have updated theta."""
        return int(self.batch.state.counts[USED, self.lane])

    @property
    def moved(self) -> int:
        """Number of samples with motion: those that have updated theta, or have served to find P(0)."""
        return self.learned + int(self.batch.state.counts[SEEDING, self.lane])

    def deviations(self) -> Deviations | None:
        """Present deviations of the estimates; None: P(0) is not found yet."""
        return self._status.deviations()

    def move_nominal(self, step: Floats) -> None:
        """Move the nominal values by a step (p,); the estimates stay."""
        self.batch.move_nominal(self.lane, step)

    def apply(
        self,
        cusum: Iterable[BatchEvent] = (),
        multimodel: Iterable[MultiModelEvent] = (),
        samples: SampleBlock | None = None,
    ) -> list[AlarmChange]:
        """Make alarms of the events of the alarm source, in order of time; events of the other detector are ignored.

        ``samples``: the samples of the events; they say whether the axis was in the calibrated conditions.
        """
        if samples is not None:
            self._open_us = max(self._open_us, last_open_us(samples))
        if self.alarm_source == "multimodel" and self.multimodel is not None:
            return self._tracker.update(multimodel, in_context(self.multimodel.interpret, samples, self.look_alike))
        events = (event for event in cusum if not isinstance(event, EstimateReading))
        return self._tracker.update(events, in_context(self.cusum.interpret, samples, self.look_alike))

    def status(self) -> AxisStatus:
        """Present status of the axis."""
        detectors = tuple(
            DetectorStatus(detector.name, detector.name == self.alarm_source, *detector.leading())
            for detector in (self.cusum, self.multimodel)
            if detector is not None
        )
        status = self._status.read(self._tracker, self._open_us, detectors)
        status = replace(status, unjudged_s=self._unjudged() * self.settings.interval_s)
        if self.judged_us is None or status.time_us is None or self.batch.judged[self.lane]:
            return status
        left_s = max(0.0, (self.judged_us - status.time_us) * 1e-6)
        return replace(status, judged_in_s=left_s, waits=self.waits)

    @property
    def multimodel_key(self) -> str:
        """Key of a saved state of the multi-model detector."""
        return f"multimodel schema={MULTIMODEL_SCHEMA} {self.key}"

    def to_arrays(self) -> Arrays:
        """The state to save, as arrays by name; that of the multi-model detector is not included."""
        floats, ints = self.batch.column(self.lane)
        t = self._tracker
        alarms = {"alarms": (*t.ended, *t.open), "unreported": t.unreported}
        own = {"floats": floats, "ints": ints, "open_us": np.array([self._open_us], np.int64)}
        return own | {k: alarms_to_array(a) for k, a in alarms.items()}

    def from_arrays(self, arrays: Arrays) -> None:
        """Restore a saved state; alarms with causes that the axis no longer has are discarded.

        Raises:
            KeyError: an array is missing.
            ValueError: the state does not belong to this model, or is damaged.
        """
        alarms, unreported = (alarms_from_array(arrays[name], self.causes) for name in ("alarms", "unreported"))
        open_us = np.asarray(arrays.get("open_us", [NEVER]), np.int64)  # earlier versions did not save it
        if open_us.shape != (1,):
            raise ValueError(f"open_us of shape {open_us.shape} does not fit")
        self.batch.restore(self.lane, np.asarray(arrays["floats"], float), np.asarray(arrays["ints"], np.int64))
        self._open_us = int(open_us[0])
        self._judged_from, self._learned_unjudged = self.learned, 0
        self._tracker = AlarmTracker(alarms, unreported, *self._reopen_us)


def _model_key(model: AxisModel) -> str:
    drive = model.drive
    name = f"{drive.name}/{drive.output}/{_fingerprint(drive):x}"
    return f"drive={name} {sorted(model.nominal.items())}"


def _fingerprint(drive: Drive) -> int:
    """Hash of the structure of a drive as the kernel uses it; the same in every process and version.

    Its text is that of the first version, in which a term was called Term: with another one, an upgrade would lose the
    checkpoints and histories.
    """
    terms = [
        f"Term(matrix={t.matrix!r}, row={t.row}, col={t.col}, coefficient={t.coefficient!r}, powers={t.powers!r})"
        for t in drive.terms
    ]
    states = [state.name for state in drive.states]
    structure = f"({states!r}, {drive.inputs!r}, ({', '.join(terms)}{',' * (len(terms) == 1)}), {drive.speed_state!r})"
    return int.from_bytes(structure.encode(), "big") % _PRIME


def _columns(samples: SampleBlock) -> dict[str, Any]:
    """Arguments of ``AxisBatch.run`` for a single axis: each array gets a last dimension of length 1."""
    values = zip(samples._fields[:6], samples[:6], strict=True)
    return {name: array[..., np.newaxis] for name, array in values if array is not None}
