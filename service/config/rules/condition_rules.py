"""Cross-checks of operating conditions: their signals exist, and scheduled parameters are monitored."""

from collections.abc import Iterator

import numpy as np

from monitor_core.drive import HEAT, LOAD, AxisModel, Conditions, NominalSchedule, Operating, Term, split_name
from monitor_core.wording import did_you_mean
from service.config.conditions import (
    Schedule,
    load_torques,
    nominal_schedule,
    schedules_of,
    signal_names,
    term_of,
    weight_of,
)
from service.config.drives import holds_weight, not_identified, watches_load
from service.config.problems import CheckFinding
from service.config.rules.bus_rules import same_names
from service.config.rules.model_rules import decided_model, usable_drive
from service.config.schema import AxisConfig, FurtherSignalConfig, RobotConfig
from service.config.schema.base_table import Undecidable
from service.config.toml_lines import Keys


def signals_of_axes(robot: RobotConfig) -> Iterator[CheckFinding]:
    """A signal that is the motion of another axis refers to an axis of the same robot on the same bus."""
    others = {other.name: other for other in robot.axis}
    for k, axis in enumerate(robot.axis):
        for n, s in enumerate(axis.signal):
            path: Keys = ("axis", k, "signal", n, "axis")
            if s.axis is None:
                continue
            if s.axis not in others:
                yield CheckFinding(path, f"no axis of that name: {did_you_mean(s.axis, others)}")
            else:
                yield from (CheckFinding(path, problem) for problem in _no_motion(axis, s, others[s.axis]))


def _no_motion(axis: AxisConfig, s: FurtherSignalConfig, other: AxisConfig) -> Iterator[str]:
    """Why a signal of an axis cannot be the motion of this other axis."""
    angle, derivative = other.angle, "a speed" if s.speed else "an acceleration"
    if s.is_derivative and angle is None:
        yield f"the speed of {s.axis} is measured: {derivative} is that of an angle"
    if s.is_derivative and not other.is_sampled_as(axis):
        yield (
            f"it is sampled every {other.sample_interval_s:g} s, this axis every {axis.sample_interval_s:g} s:"
            f" {derivative} is taken from samples that come with those of this axis"
        )
    # An angle that wraps after a whole turn is possible, as its cosine is continuous.
    wraps = angle is not None and angle.wrap_period is not None
    goes_on = angle is not None and angle.wraps_after_a_turn(s.factor)
    if wraps and (s.is_derivative or not goes_on):
        yield (
            f"the angle of {s.axis} wraps after each turn, and a signal does not count its turns: use an angle that"
            " does not wrap, from a message"
        )
    if axis.bus != other.bus:
        yield (
            f"it is on the bus {other.bus}, this axis on {axis.bus}: signals come from an axis's own bus, where their"
            " order is certain"
        )


def sources(axis: AxisConfig) -> Iterator[CheckFinding]:
    """Auxiliary signals have different names, and each has one source."""
    yield from same_names("signal", axis.signal)
    if axis.model.nominal_file is not None and axis.model.nominal_file.thermal is not None:
        for n, s in enumerate(axis.signal):
            if s.name == HEAT:
                message = f"the nominal_file calls the heat of the axis {HEAT}: give this signal another name"
                yield CheckFinding(("signal", n, "name"), message)
    for n, s in enumerate(axis.signal):
        path: Keys = ("signal", n)
        if s.speed and s.acceleration:
            yield CheckFinding((*path, "speed"), "it is an acceleration: remove this, or", (*path, "acceleration"))
        if s.axis is not None:
            for key in ("message", "signal"):
                if getattr(s, key) is not None:
                    message = "it is the motion of another axis: remove this, or"
                    yield CheckFinding((*path, key), message, (*path, "axis"))
        elif (s.message is None) != (s.signal is None):
            missing = "message" if s.message is None else "signal"
            yield CheckFinding((*path, missing), "missing: message and signal go together")
        elif s.message is None and s.column is None:
            yield CheckFinding((*path, "column"), "missing: it is either in a column or in a message and signal")


def gates(axis: AxisConfig) -> Iterator[CheckFinding]:
    """A gate has one condition on a signal of the axis."""
    for k, gate in enumerate(axis.gate):
        path: Keys = ("gate", k)
        if problem := _no_signal(gate.signal, axis):
            yield CheckFinding((*path, "signal"), problem)
        given = [key for key in ("equals", "above", "below") if getattr(gate, key) is not None]
        if len(given) != 1:
            key = given[1] if given else "equals"
            yield CheckFinding((*path, key), "a gate has one of equals, above and below")


def _no_signal(name: str, axis: AxisConfig) -> str:
    """Why this is no signal of the axis; empty: it is one."""
    names = [s.name for s in axis.signal]
    try:
        return "" if name in names or term_of(name, names).is_signal else "must be a signal itself"
    except ValueError as error:
        return str(error)


def schedules(axis: AxisConfig) -> Iterator[CheckFinding]:
    """A schedule uses a signal of the axis or a function of it; no two are the same; ranges have ordered ends."""
    seen = dict[tuple[str, str], Keys]()
    for path, v in schedules_of(axis):
        if v.range is not None and not v.range[0] < v.range[1]:
            yield CheckFinding(_key(path, "range"), "must be [lowest, highest] with lowest < highest")
        try:
            term = str(term_of(v.signal, signal_names(axis)))
        except ValueError as error:
            yield CheckFinding(_key(path, "signal"), f"{v.parameter} follows {v.signal}: {error}")
            continue
        if (first := seen.setdefault((v.parameter, term), path)) != path:
            yield CheckFinding(_key(path, "signal"), f"{v.parameter} follows {term} already by", first)


def scheduled_parameters(axis: AxisConfig) -> Iterator[CheckFinding]:
    """A scheduled parameter is monitored; its slopes are all of the parameter or all of its reciprocal."""
    monitored = {split_name(name)[0] for name in axis.model.monitor}
    first, weight = dict[str, str](), _weight(axis)
    for path, v in schedules_of(axis):
        if v in weight:
            continue
        key, base = _key(path, "parameter"), split_name(v.parameter)[0]
        if base not in monitored:
            message = (
                f"{v.parameter} follows {v.signal}, but only a monitored parameter can follow: add it to monitor, or"
                " identify it without"
            )
            yield CheckFinding(key, message)
        elif (other := first.setdefault(base, v.parameter)) != v.parameter:
            yield CheckFinding(key, f"slopes of both {v.parameter} and {other}: give one of them")


def load(axis: AxisConfig) -> Iterator[CheckFinding]:
    """A monitored load needs a weight that follows the pose; its nominal value is 1."""
    usable_drive(axis)
    if f"1/{LOAD}" in axis.model.monitor and holds_weight(axis):
        place = ("model", "monitor", axis.model.monitor.index(f"1/{LOAD}"))
        yield CheckFinding(place, f'the load is monitored as it is: write "{LOAD}"')
    if not watches_load(axis):
        return
    if LOAD in axis.model.nominal:
        message = "is relative to the nominal weight, so its nominal value is 1: remove this"
        yield CheckFinding(("model", "nominal", LOAD), message)
    to_come = axis.records_only and axis.model.nominal_file is None
    if not load_torques(axis) and not to_come and not not_identified(axis):
        message = (
            "no constant torque follows the pose, so there is no weight to compare the load with: find it with"
            ' `axiswatch identify --schedule "tau0: cos(angle)"`'
        )
        yield CheckFinding(("model", "monitor", axis.model.monitor.index(LOAD)), message)


def _weight(axis: AxisConfig) -> tuple[Schedule, ...]:
    usable_drive(axis)
    return weight_of(axis)


def values_at_ends(axis: AxisConfig) -> Iterator[CheckFinding]:
    """Scheduled nominal values stay within their bounds over the whole range of each signal."""
    model, weight = decided_model(axis), _weight(axis)
    for path, v in schedules_of(axis):
        for end in v.range or ():
            if v not in weight and _leaves_bounds(model, nominal_schedule(v), end):
                message = f"{v.parameter} would leave its bounds at {v.signal} = {end:g}"
                yield CheckFinding(_key(path, "slope"), message)


def _leaves_bounds(model: AxisModel, follow: NominalSchedule, end: float) -> bool:
    """Whether theta_0 leaves its bounds at this value of the term."""
    plain = follow._replace(term=Term.read("term"), low=end, high=end)
    operating = Operating(model, Conditions(plain.term.signals, (plain,)))
    shift, _ = operating.take(np.zeros(1, np.int64), np.zeros(1), np.array([[end]]))
    return bool(np.isnan(shift).any())


def on_the_bus(axis: AxisConfig) -> Iterator[CheckFinding]:
    """The signals that a monitored axis needs are on its bus."""
    if axis.records_only:
        return
    purposes = {signal: f"{v.parameter} follows it" for _, v in schedules_of(axis) for signal in _signals(v, axis)}
    purposes |= {g.signal: "it is a gate" for g in axis.gate}
    for n, s in enumerate(axis.signal):
        if s.axis is None and s.message is None and s.name in purposes:
            message = f"missing: {purposes[s.name]}, so it must be on the bus of the axis"
            yield CheckFinding(("signal", n, "message"), message)


def others_stand_still(axis: AxisConfig) -> Iterator[CheckFinding]:
    """If the configuration says that the other axes stand still, nothing follows their motion."""
    if axis.model.conditions is None:
        return
    moving = {s.name: s.axis for s in axis.signal if s.axis is not None}
    for path, v in schedules_of(axis):
        for other in [moving[signal] for signal in _signals(v, axis) if signal in moving][:1]:
            message = f"but {v.parameter} follows the motion of {other}, by"
            yield CheckFinding(("model", "conditions"), message, path)


def _signals(v: Schedule, axis: AxisConfig) -> tuple[str, ...]:
    try:
        return term_of(v.signal, signal_names(axis)).signals
    except ValueError:  # another check reports that
        raise Undecidable("signal") from None


def _key(path: Keys, key: str) -> Keys:
    """The path of a key in a table of the configuration; for a schedule of the nominal file, the path of that file."""
    return path if path[-1] == "nominal_file" else (*path, key)


CONDITION_RULES = (sources, gates, schedules, scheduled_parameters, load, on_the_bus, others_stand_still)
