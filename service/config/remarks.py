"""Remarks to the user on a valid configuration: its assumptions, and possible improvements."""

import math
from collections.abc import Callable, Iterator
from functools import cache, partial

from monitor_core.drive import LOAD, AxisModel
from monitor_core.monitoring import RMS_SPEED, short_memory, unidentifiable_words
from monitor_core.settings import Settings
from monitor_core.wording import duration, listed
from service.can.bus import FD_INTERFACES
from service.can.frames import CLASSIC_BYTES
from service.can.messages import Message, MessageSet, find_signal, key_of_message
from service.config.axis_detectors import Detectors, detectors_of
from service.config.axis_settings import (
    awaits_identification,
    axis_settings,
    predictor_of,
    rounded,
    step_noise,
    unidentifiable_pairs,
)
from service.config.bus_messages import messages_of
from service.config.conditions import has_ambient_heat, load_torques, schedules_of
from service.config.drives import axis_model
from service.config.schema import AxisConfig, Config, NamedAxis
from service.config.unit_names import UNITS, MeasuredQuantity, unit_passed_over

_KnownOn = Callable[[str], MessageSet]
"""Function that returns the messages of a bus by its name"""
_NEARLY = 1e-3
_EXACT = 1e-7
_BUS_SCATTER_S = 1e-5
"""Times of receipt scatter by more than this, as a frame of CAN alone takes ten times as long [s]"""


def remarks(config: Config) -> Iterator[str]:
    """All remarks.

    Raises:
        AxisError: an axis cannot be monitored as configured.
        DescriptionError: the description of a bus cannot be used.
    """
    yield from _shared_torque(config)
    yield from _assumptions(config)
    known_on = cache(partial(messages_of, config))
    yield from _by_events(config, known_on)
    yield from _long_frames(config, known_on)
    for axis in config.axes:
        yield from _other_unit(axis, known_on)
    if unknown := [axis.id for axis in config.axes if awaits_identification(axis.config)]:
        yield (
            f"{listed(unknown)}: not identified yet; `axiswatch commission` or `identify` finds"
            f" {'its' if len(unknown) == 1 else 'their'} values in a record of the healthy"
            f" {'axis' if len(unknown) == 1 else 'axes'}, `run` needs them"
        )
    for axis in config.axes:
        if awaits_identification(axis.config):
            continue
        model = axis_model(axis.config)
        settings = axis_settings(axis, model)
        yield from _unwatched_load(axis.config, axis.id)
        yield from _fixed_allowance(axis)
        yield from _short_memory(axis, model, settings)
        for words in unidentifiable_words(unidentifiable_pairs(axis.config)):
            yield f"{axis.id}: {words}"
        yield from _small_noise(axis, known_on)
        yield from _exact_times(axis)
        yield from _nearly_a_turn(axis)
        yield from _detector(axis, detectors_of(axis, model, settings))


def _shared_torque(config: Config) -> Iterator[str]:
    """A signal that is the torque of several axes, which must be wrong for all but one."""
    used: dict[tuple[object, ...], list[str]] = {}
    for axis in config.axes:
        torque, bus = axis.config.torque, axis.config.bus
        if torque.column is not None:
            used.setdefault((f"column {torque.column}",), []).append(axis.id)
        if torque.signal:
            used.setdefault((f"signal {torque.signal} of {torque.message}", bus), []).append(axis.id)
    for (where, *_), axes in used.items():
        if len(axes) > 1:
            yield f"{', '.join(axes)}: {where} is the torque of each of them; give each axis its own"


def _assumptions(config: Config) -> Iterator[str]:
    """For each robot: the assumption that is made if the configuration states no conditions."""
    for robot in config.robot:
        names = [
            axis.name
            for axis in robot.axis
            if not (axis.model.conditions is not None or axis.gate or schedules_of(axis))
        ]
        if names and len(robot.axis) > 1:
            yield (
                f"{robot.name}: {', '.join(names)}: monitored as if the other axes stood still. Where their pose"
                " changes the inertia, there will be alarms. Let nominal values follow it"
                " ([[robot.axis.model.schedule]]),"
                " monitor a reference motion only ([[robot.axis.gate]]), or say"
                ' conditions = "others stand still" in [robot.axis.model]'
            )


def _unwatched_load(axis: AxisConfig, axis_id: str) -> Iterator[str]:
    """The load is not monitored although weight or inertia follows the pose and the payload may change."""
    if LOAD not in axis.model.monitor and load_torques(axis):
        yield (
            f'{axis_id}: the torque follows what the axis carries, but "{LOAD}" is not in monitor: another payload will'
            " be reported as a fault of the drive, most likely of kT"
        )


def _fixed_allowance(axis: NamedAxis) -> Iterator[str]:
    """The multi-model detector raises the alarms of an axis whose friction follows the hall."""
    if has_ambient_heat(axis.config) and axis.config.detector.alarm_source == "multimodel":
        yield (
            f'{axis.id}: with alarm_source = "multimodel" a colder or warmer hall may raise alarms, as the allowance of'
            " this detector is fixed, and nothing is tested beyond the heat of the records; without alarm_source the"
            " CUSUM tests raise the alarms, with an allowance for the hall"
        )


def _short_memory(axis: NamedAxis, model: AxisModel, settings: Settings) -> Iterator[str]:
    """A memory that is short compared with the time constants of the predictor."""
    short = short_memory(model, settings, axis.config.estimator.joint_state)
    if short is None:
        return
    words = (
        f"{axis.id}: a memory of {short.memory_s:.3g} s is short compared with {short.slowest_s:.3g} s, the slowest"
        " time constant of the predictor"
    )
    if short.joint_by_default:
        yield (
            f"{words}: its state moves with the estimates (joint_state), so that they scatter as reported; from"
            f" {short.needed_s:.3g} s on this is not needed, and a change is detected up to 30 % sooner"
        )
    else:
        yield f"{words}: from {short.needed_s:.3g} s on estimates scatter as reported"


def _small_noise(axis: NamedAxis, known_on: _KnownOn) -> Iterator[str]:
    """An output noise smaller than that of the resolution."""
    given, least = predictor_of(axis.config).output_noise, _least_noise(known_on, axis.config)
    if given is not None and least is not None and given < least * (1 - _NEARLY):
        yield (
            f"{axis.id}: output_noise = {given:.3g} is below {least:.3g}, which the resolution of the"
            f" {axis.config.output} makes by itself (a step over the root of 12): the predictor would follow the"
            " steps"
        )


def _exact_times(axis: NamedAxis) -> Iterator[str]:
    """Prediction errors so small that their record had exact times, which times of receipt are not."""
    config, model = axis.config, axis.config.model
    exact = config.time.clock != "receipt" or config.time.counter_signal is not None
    if exact or config.records_only or config.output != "angle":
        return
    if model.nominal_file is None or model.thresholds_file is None:
        return
    speed = max((r.high for r in model.thresholds_file.range if r.condition == RMS_SPEED), default=0.0)
    error = math.sqrt(model.nominal_file.predictor.innovation_variance)
    if error < _BUS_SCATTER_S * speed:
        yield (
            f"{axis.id}: its nominal values predict the angle to {error:.2g} rad, as from a record with times that"
            f" are exact to {1e6 * error / speed:.2g} us. Times of receipt on a bus scatter more, and would raise"
            ' alarms: set clock = "cyclic" in [robot.axis.time], name the sample counter, or commission with a record'
            " of this bus"
        )


def _other_unit(axis: NamedAxis, known_on: _KnownOn) -> Iterator[str]:
    """A signal with a unit, by its description or column name, that no factor converts."""
    config = axis.config
    motion: MeasuredQuantity = "angle" if config.angle is not None else "speed"
    quantities: tuple[MeasuredQuantity, ...] = ("torque", motion)
    for quantity, source in zip(quantities, (config.torque, config.motion), strict=True):
        place, text = f"column {source.column}", source.column or ""
        if not config.records_only:
            place = f"{source.message}.{source.signal}"
            text = find_signal(known_on(config.bus), source.message, source.signal)[1].unit or ""
        current = quantity == "torque" and config.torque.kT_Nm_per_A is not None
        unit = unit_passed_over(text, quantity, source.factor, current)
        if unit is not None and unit.factor is not None:
            yield (
                f"{axis.id}: {place} is in {unit.words} by its description, but {quantity}.factor ="
                f" {source.factor:g} takes it as {'A' if current else UNITS[quantity]}; {quantity}.factor ="
                f" {source.factor * unit.factor:.6g} converts it"
            )


def _by_events(config: Config, known_on: _KnownOn) -> Iterator[str]:
    """Drives whose torque and motion are not sampled at the same time."""
    for axis in config.axes:
        if axis.config.canopen is None or axis.config.records_only:
            continue
        known = known_on(axis.config.bus)
        late = [m.name for m in _messages(axis.config, known) if key_of_message(m) not in known.sync]
        if late:
            yield (
                f"{axis.id}: {listed(list(dict.fromkeys(late)))} is sent by events, not after a SYNC: torque and motion"
                " are of different moments, and none come while they do not change; set transmission type 1 (object"
                " 0x1800.2) with the tool of the drive, and let the master send a SYNC each cycle"
            )


def _long_frames(config: Config, known_on: _KnownOn) -> Iterator[str]:
    """CAN FD messages on buses that are not opened for CAN FD."""
    for bus in config.bus:
        if bus.interface in FD_INTERFACES or "fd" in bus.options:
            continue
        known = known_on(bus.name)
        axes = [axis.config for axis in config.axes if axis.config.bus == bus.name]
        used = [message for axis in axes for message in _messages(axis, known)]
        if long := [message.name for message in used if message.length > CLASSIC_BYTES]:
            yield (
                f"bus {bus.name}: {listed(list(dict.fromkeys(long)))} needs CAN FD; {bus.interface} gives such frames"
                " once it is opened for them: options = { fd = true } with the bit rates that python-can asks for"
            )


def _messages(axis: AxisConfig, known: MessageSet) -> list[Message]:
    """The messages of torque and motion."""
    sources = axis.torque, axis.motion
    return [find_signal(known, source.message, source.signal)[0] for source in sources]


def _least_noise(known_on: _KnownOn, axis: AxisConfig) -> float | None:
    """The noise from the resolution of the encoder, or, if that is not given, of its signal on the bus."""
    if (noise := step_noise(axis)) is not None or axis.records_only:
        return noise
    _, signal = find_signal(known_on(axis.bus), axis.motion.message, axis.motion.signal)
    return None if signal.is_float else rounded(float(signal.scale) * axis.motion.factor)


def _nearly_a_turn(axis: NamedAxis) -> Iterator[str]:
    angle = axis.config.angle
    if angle is None or angle.wrap_period is None:
        return
    turns = abs(angle.factor) * angle.wrap_period / (2 * math.pi)
    short = abs(turns - round(turns))
    if round(turns) > 0 and _EXACT < short < _NEARLY:
        yield (
            f"{axis.id}: wrap_period differs from a turn by {2 * math.pi * short:.2g} rad, so the angle would jump each"
            f" time; exact is {2 * math.pi * round(turns) / abs(angle.factor):.10g}"
        )


def _detector(axis: NamedAxis, found: Detectors) -> Iterator[str]:
    """A multi-model detector that does not run, or has no thresholds from a calibration."""
    wanted = axis.config.detector
    if found.multimodel is None and wanted.shadow and found.why:
        yield f"{axis.id}: the multi-model detector does not run: {found.why}. The CUSUM tests raise the alarms"
    elif found.alarm_source == "multimodel" and axis.config.model.thresholds_file is None:
        yield (
            f"{axis.id}: the thresholds of the multi-model detector are the guaranteed ones: at most one false"
            f" alarm in {duration(wanted.budget_s)} if the model is exact. A real axis needs thresholds of its own:"
            " `axiswatch calibrate`"
        )
