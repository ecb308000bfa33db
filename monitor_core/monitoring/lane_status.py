"""Status of one lane of a batch: its estimates, its tested parameters, and why others are not tested."""

import math
from functools import cached_property
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.detection.alarm import DetectorName
from monitor_core.detection.cusum.cusum_evidence import HELD, INVALID
from monitor_core.detection.multimodel.multimodel_detector import MultiModelDetector
from monitor_core.kernel.admission import GATED, IDLE
from monitor_core.kernel.state import COUNTERS, NEVER, SEEDING, UNSEEN, USED
from monitor_core.monitoring.alarm_tracker import AlarmTracker
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
from monitor_core.monitoring.not_tested import NotTested, SeedingRemedy, remedy
from monitor_core.monitoring.recommended_settings import time_constant

_OBSERVATION = tuple(Observation)
_TRACKING = {
    Observation.OBSERVED: Status.TRACKING,
    Observation.WEAK: Status.WEAK,
    Observation.UNSEEN: Status.UNSEEN,
}


class Deviations(NamedTuple):
    """Deviations of the estimates from the nominal values, and the deviations that the tests tolerate."""

    d: Floats
    """(p,) theta - theta_0(s); NaN where not observed"""
    covariance: Floats
    """(p, p) covariance of d"""
    tolerated: Floats
    """(p,) tolerated deviation: nu, or the allowance of the multi-model detector if that is the alarm source"""
    errors: Floats
    """(p,) standard deviation of the constant errors of healthy estimates, beyond their scatter"""


class LaneStatus:
    """Reads the status of one lane of a batch.  ``alarm_source``: the detector that raises its alarms.

    ``multimodel``: the multi-model detector of the axis; None: it does not run.
    """

    def __init__(
        self, batch: AxisBatch, lane: int, multimodel: MultiModelDetector | None, alarm_source: DetectorName
    ) -> None:
        self._batch, self._lane, self._multimodel = batch, lane, multimodel
        self._by_models = alarm_source == "multimodel"
        self._model, self._settings = batch.models[lane], batch.settings[lane]
        self._memory_s = self._settings.memory * self._settings.interval_s
        self._alpha1: list[float] = self._settings.tests(len(self._model.scale))[0].tolist()

    def read(self, alarms: AlarmTracker, open_us: int, detectors: tuple[DetectorStatus, ...]) -> AxisStatus:
        """Present status of the axis.

        Args:
            alarms: alarms of the axis.
            open_us: time of the last sample with an open gate [us], or NEVER.
            detectors: evidence of its detectors.
        """
        st, a = self._batch.state, self._lane
        return AxisStatus(
            time_us=None if st.t[a] == NEVER else int(st.t[a]),
            parameters=tuple(self._parameter(i, alarms, open_us) for i in range(len(self._model.monitored))),
            innovation_variance=float(st.lam0_running[a]),
            confounded=self._confounded(),
            counters=dict(zip(COUNTERS, map(int, st.counts[:, a]), strict=True)),
            detectors=detectors,
            remedy=self._remedy(),
            memory_s=self._memory_s,
            covariance=tuple(map(tuple, self._covariance().tolist())),
        )

    def deviations(self) -> Deviations | None:
        """Present deviations of the estimates; None: P(0) is not found yet."""
        st, a = self._batch.state, self._lane
        if st.seed_left[a] or st.t[a] == NEVER:
            return None
        d = st.theta[:, a] - self._model.theta0 - st.shift[:, a]
        nu = np.array([self._nu(i, float(st.P[i, i, a])) for i in range(len(d))])
        p, scale = len(d), self._model.scale
        beyond = self._batch.allowance[:, a] - self._settings.tests(p)[2] * scale
        errors = self._settings.model_errors(p)
        follows = errors > 0
        if follows.any():
            # The fit assigns an error of the heat to one kind of friction by chance: use the same error for all kinds.
            errors = np.maximum(errors, math.sqrt(np.mean(errors[follows] ** 2)))
        return Deviations(
            np.where(st.observed[:, a] == UNSEEN, math.nan, d),
            self._covariance(),
            np.where(follows, errors * scale, nu) if self._by_models else nu,
            self._settings.size_errors(p) * scale + beyond,
        )

    def _covariance(self) -> Floats:
        return np.asarray(self._settings.lam0 / self._settings.divisor * self._batch.state.P[..., self._lane])

    def _parameter(self, i: int, alarms: AlarmTracker, open_us: int) -> ParameterStatus:
        st, a, parameter = self._batch.state, self._lane, self._model.parameters[i]
        P_ii, estimate = float(st.P[i, i, a]), st.theta_seen if st.observed[i, a] == UNSEEN else st.theta
        return ParameterStatus(
            name=parameter.name,
            unit=parameter.unit,
            meaning=parameter.meaning,
            nominal=float(self._model.theta0[i] + st.shift[i, a]),
            estimate=math.nan if self._is_invalid(i) else float(estimate[i, a]),
            standard_deviation=standard_deviation(self._settings, P_ii),
            p_diagonal=P_ii,
            g_up=float(st.g[0, i, a]),
            g_down=float(st.g[1, i, a]),
            h=float(self._batch.thresholds[i, a]),
            nu=self._nu(i, P_ii),
            status=Status.ALARM if alarms.is_open(parameter.name) else self._status(i),
            observation=_OBSERVATION[st.observed[i, a]],
            not_tested=self._not_tested(i, open_us),
            tested_s=self._tested_samples(i) * self._settings.interval_s,
        )

    def _status(self, i: int) -> Status:
        """State of the estimate of parameter i, regardless of alarms."""
        st, a = self._batch.state, self._lane
        if st.t[a] == NEVER:
            return Status.WAITING
        if st.t[a] < st.settled[a]:
            return Status.SETTLING
        if st.seed_left[a] > 0:
            return Status.SEEDING
        if self._is_invalid(i):
            return Status.INVALID
        return _TRACKING[_OBSERVATION[st.observed[i, a]]]

    def _is_invalid(self, i: int) -> bool:
        """Whether the estimate is at a bound, or the model no longer explains the measurements."""
        st, a, (lower, upper) = self._batch.state, self._lane, self._batch.limits
        theta0, theta = self._model.theta0[i] + st.shift[i, a], st.theta[i, a]
        bound = upper[i, a] if theta > theta0 else lower[i, a]
        held = bool(abs(theta - bound) <= HELD * abs(theta0 - bound))
        return held or bool(st.lam0_running[a] > INVALID * self._settings.lam0)

    def _nu(self, i: int, P_ii: float) -> float:
        allowance = float(self._batch.allowance[i, self._lane])
        return self._alpha1[i] * math.sqrt(self._settings.lam0 * P_ii) + allowance

    def _not_tested(self, i: int, open_us: int) -> NotTested | None:
        """Reason why the alarm source would not find a change of parameter i now; None: it would find it."""
        st, a, by_models = self._batch.state, self._lane, self._by_models
        unseen, seeding = st.observed[i, a] == UNSEEN, not by_models and st.seed_left[a]
        again = seeding and st.counts[SEEDING, a] > self._settings.seed_updates - st.seed_left[a]
        blocked = again and (st.observed[:, a] == UNSEEN).any()
        reasons = {
            NotTested.NO_SAMPLE: st.t[a] == NEVER,
            NotTested.UNIDENTIFIABLE: self._settings.unidentifiable,
            NotTested.SETTLING: st.t[a] < st.settled[a],
            # Only if the gate has been closed for a memory: a robot that rests between two motions counts as tested.
            NotTested.CONDITIONS: st.mode[a] == GATED and (int(st.t[a]) - open_us) * 1e-6 > self._memory_s,
            NotTested.WARM_UP: not self._batch.judged[a],
            NotTested.NOT_OBSERVED: unseen and (st.mode[a] == IDLE or not st.seed_left[a]),
            NotTested.UNCERTAIN: (again and unseen) or (not seeding and self._is_uncertain(i)),
            NotTested.BLOCKED: blocked,
            NotTested.SEEDING: seeding,
            NotTested.NO_THRESHOLD: by_models and self._model.monitored[i] not in self._tested_causes(),
        }
        return next((reason for reason, holds in reasons.items() if holds), None)

    def _is_uncertain(self, i: int) -> bool:
        """Whether the CUSUM tests could not find a change of parameter i by its whole size, as commissioned or now."""
        st, a = self._batch.state, self._lane
        nu = self._nu(i, min(st.P_nom[i, a], st.P[i, i, a]))
        return not self._by_models and nu >= self._model.scale[i]

    def _tested_samples(self, i: int) -> int:
        if self._by_models and self._multimodel is not None:
            tested = self._multimodel.has_bank and self._model.monitored[i] in self._tested_causes()
            return self._multimodel.bank.tested_samples if tested else 0
        return int(self._batch.state.tested[i, self._lane])

    def _tested_causes(self) -> tuple[str, ...]:
        """Causes for which the multi-model detector has a threshold; before its first sample: all."""
        if self._multimodel is None or not self._multimodel.has_bank:
            return self._model.monitored
        return self._multimodel.bank.causes

    def _remedy(self) -> SeedingRemedy | None:
        st, a = self._batch.state, self._lane
        if not st.seed_left[a] or self._by_models:
            return None
        moved = int(st.counts[SEEDING, a] + st.counts[USED, a])
        return remedy(self._slowest_s, self._settings, int(st.seed_left[a]), moved)

    @cached_property
    def _slowest_s(self) -> float:
        """Slowest time constant of the predictor [s]; cached, as it takes longer than all the rest of a status."""
        return time_constant(self._model, self._settings.interval_s, self._settings.K)

    def _confounded(self) -> tuple[str, ...]:
        st, a = self._batch.state, self._lane
        doubts = unidentifiable_words(self._settings.unidentifiable)
        if not st.unobserved[a] or st.seed_left[a]:  # without P(0) there is nothing to compare P with
            return doubts
        return doubts + confounded(st.P[:, :, a], st.P_nom[:, a], self._model.scale, self._model.monitored)
