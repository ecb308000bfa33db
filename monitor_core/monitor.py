"""AxisMonitor: samples of one axis in, facts and alarm episodes out."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from monitor_core.bank import Bank, standard_deviation
from monitor_core.directions import confounded, untold
from monitor_core.episodes import Calm, Crossing, Episode, EpisodeBook
from monitor_core.facts import AxisFacts, Observation, ParameterFacts, Status
from monitor_core.kernel.block import Trace
from monitor_core.kernel.state import COUNTERS, NEVER, SCHEMA, UNSEEN
from monitor_core.kernel.tables import Floats
from monitor_core.model import AxisModel, Drive
from monitor_core.settings import Settings

_T = TypeVar("_T", bound=np.generic)
_PRIME = 2**127 - 1
INVALID = 100.0
"""Running innovation variance over lambda_0: with errors ten times as large as they were the model does not hold."""
HELD = 0.1
"""Of the way from the nominal value to a bound: an estimate that is held scatters by so much."""
_OBSERVATION = tuple(Observation)
_TRACKING = {
    Observation.OBSERVED: Status.TRACKING,
    Observation.WEAK: Status.WEAK,
    Observation.UNSEEN: Status.UNSEEN,
}
_OF_NO_STATE: dict[str, Any] = {
    "alpha1": 0.0,
    "alpha2": 1.0,
    "P0": (),
    "run_on": False,
    "outlier": 0.0,
    "widen": 0.0,
    "untold": (),
}
"""Settings that may change from one run to the next, and a saved state goes on."""
Arrays = dict[str, NDArray[np.generic]]


class AxisMonitor:
    """One lane of a bank, with the alarm episodes of its axis.

    For one axis alone: ``AxisMonitor.alone(model, settings)`` and then ``run``.  For many, run the bank and hand each
    event to its monitor's ``apply``.
    """

    def __init__(self, bank: Bank, axis: int, open_episodes: Iterable[Episode] = ()) -> None:
        self.bank, self.axis = bank, axis
        self.book = EpisodeBook(open_episodes)

    @classmethod
    def alone(cls, model: AxisModel, settings: Settings) -> AxisMonitor:
        """The monitor of a bank of one."""
        return cls(Bank([model], [settings]), 0)

    @property
    def model(self) -> AxisModel:
        """The model of this axis."""
        return self.bank.models[self.axis]

    @property
    def settings(self) -> Settings:
        """The settings of this axis."""
        return self.bank.settings[self.axis]

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

    def run(
        self,
        t_us: NDArray[np.int64],
        u: Floats,
        y: Floats,
        shift: Floats | None = None,
        gate: NDArray[np.bool_] | None = None,
    ) -> list[Episode]:
        """Run samples (N,) of a monitor that is alone; returns the episodes raised, updated or ended.

        ``shift`` (N, p) and ``gate`` (N,) as for ``Bank.run``.
        """
        block = _column(t_us), _column(u), _column(y)
        events = self.bank.run(*block, shift=_optional(shift), gate=_optional(gate))
        return [episode for _, event in events for episode in self.apply(event)]

    def run_traced(
        self,
        t_us: NDArray[np.int64],
        u: Floats,
        y: Floats,
        shift: Floats | None = None,
        gate: NDArray[np.bool_] | None = None,
    ) -> tuple[list[Episode], Trace]:
        """As ``run``, with the recursion's values at every sample, axis dropped: theta (N, p), g (N, 2, p), .."""
        block = _column(t_us), _column(u), _column(y)
        events, trace = self.bank.run_traced(*block, shift=_optional(shift), gate=_optional(gate))
        episodes = [episode for _, event in events for episode in self.apply(event)]
        return episodes, Trace(*(field[..., 0] for field in trace))

    def apply(self, event: Crossing | Calm) -> list[Episode]:
        """Take an event of this axis; returns the episodes that it raised, updated or ended."""
        return self.book.apply(event)

    def start_from(self, theta: Floats) -> None:
        """Let the recursion start from another theta (p,) than the nominal one."""
        self.bank.state.theta[:, self.axis] = theta

    def facts(self) -> AxisFacts:
        """All that is known now."""
        st, a = self.bank.state, self.axis
        last = int(st.t[a])
        return AxisFacts(
            time_us=None if last == NEVER else last,
            parameters=tuple(self._parameter(i) for i in range(len(self.model.monitored))),
            innovation_variance=float(st.lam0_running[a]),
            confounded=self._confounded(),
            counters={name: int(st.counts[k, a]) for k, name in enumerate(COUNTERS)},
        )

    def _parameter(self, i: int) -> ParameterFacts:
        st, a, parameter = self.bank.state, self.axis, self.model.parameters[i]
        P_ii, unseen = float(st.P[i, i, a]), st.observed[i, a] == UNSEEN
        return ParameterFacts(
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
            h=float(self.bank.thresholds[i, a]),
            nu=float(self.settings.alpha1 * math.sqrt(self.settings.lam0 * P_ii)),
            status=self._status(i),
            observation=_OBSERVATION[st.observed[i, a]],
        )

    def _confounded(self) -> tuple[str, ...]:
        st, a = self.bank.state, self.axis
        doubts = untold(self.settings.untold)
        if not st.starved[a] or st.seed_left[a]:  # without P(0) there is nothing to compare P with
            return doubts
        return doubts + confounded(st.P[:, :, a], st.P_nom[:, a], self.model.scale, self.model.monitored)

    def _is_invalid(self, i: int) -> bool:
        """Its bounds hold it, or the model no longer explains what is measured."""
        st, a, (lower, upper) = self.bank.state, self.axis, self.bank.limits
        theta0, theta = self.model.theta0[i] + st.shift[i, a], st.theta[i, a]
        bound = upper[i, a] if theta > theta0 else lower[i, a]
        held = bool(abs(theta - bound) <= HELD * abs(theta0 - bound))
        return held or bool(st.lam0_running[a] > INVALID * self.settings.lam0)

    def _status(self, i: int) -> Status:
        st, a = self.bank.state, self.axis
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

    def to_arrays(self) -> Arrays:
        """The whole state, to be saved: arrays by name."""
        floats, ints = self.bank.column(self.axis)
        names = self.model.monitored
        rows = [
            (
                names.index(e.parameter),
                e.direction == "down",
                e.onset_us,
                e.raised_us,
                e.updated_us,
                e.crossings,
            )
            for e in self.book.open
        ]
        sizes = [(e.size, e.size_sd) for e in self.book.open]
        return {
            "floats": floats,
            "ints": ints,
            "episodes": np.array(rows, dtype=np.int64).reshape(-1, 6),
            "episode_sizes": np.array(sizes, dtype=float).reshape(-1, 2),
        }

    def from_arrays(self, arrays: Arrays) -> None:
        """Go on from a saved state.

        Raises:
            KeyError: an array is missing.
            ValueError: it does not belong to this model, or is damaged.
        """
        rows = zip(arrays["episodes"], arrays["episode_sizes"], strict=True)
        episodes = [self._episode(row, size) for row, size in rows]
        self.bank.restore(
            self.axis, np.asarray(arrays["floats"], float), np.asarray(arrays["ints"], np.int64)
        )
        self.book = EpisodeBook(episodes)

    def _episode(self, row: NDArray[np.generic], size: NDArray[np.generic]) -> Episode:
        i, down, onset, raised, updated, crossings = (int(v) for v in row)
        if not 0 <= i < len(self.model.monitored):
            raise ValueError(f"an episode of parameter {i}, which is not monitored")
        return Episode(
            parameter=self.model.monitored[i],
            direction="down" if down else "up",
            onset_us=onset,
            raised_us=raised,
            updated_us=updated,
            ended_us=None,
            size=float(size[0]),
            size_sd=float(size[1]),
            crossings=crossings,
        )


def _fingerprint(drive: Drive) -> int:
    """Of all that the kernel sees of a drive's structure; the same in every process."""
    seen = ([state.name for state in drive.states], drive.inputs, drive.terms, drive.speed_state)
    return int.from_bytes(repr(seen).encode(), "big") % _PRIME


def _column(values: NDArray[_T]) -> NDArray[_T]:
    return np.asarray(values)[..., np.newaxis]


def _optional(values: NDArray[_T] | None) -> NDArray[_T] | None:
    return None if values is None else _column(values)
