"""Signals: the measured motor torque, and the sensors that are outputs."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from monitor_core.kernel.tables import TORQUE
from monitor_core.modeling.components import KINDS
from monitor_core.modeling.flat import FlatEquation, FlatInput, FlatSensor, ModelError
from monitor_core.modeling.modelica.connecting import Wiring
from monitor_core.modeling.modelica.instances import Instance
from monitor_core.modeling.modelica.standard_library import SIGNAL_SOURCE


def measured_torque(model: Instance, wiring: Wiring, own: Sequence[FlatEquation]) -> FlatInput | None:
    """The input that is the motor torque: a source, an input of the model, a torque to which nothing is connected.

    Args:
        model: the whole model.
        wiring: its connections.
        own: the equations that the user wrote; a signal in them is not left open.

    Raises:
        ModelError: two of them; a signal that nothing drives, or that two drive.
    """
    written = {name for equation in own for name, _ in equation.terms}
    signals = {i.path: i for i in model.tree() if _is_signal(i)}
    groups = [[signals[name] for name in names] for names in wiring.signals.members(signals).values()]
    found = [signal for group in groups for signal in _measured(group, written)]
    if not found:  # a torque that the user's equations use, but do not set
        found = [signal for group in groups for signal in _measured(group, set())][:1]
    if len(found) > 1:
        raise ModelError(
            f"{' and '.join(i.path for i in found)} would both be the measured motor torque, but there is only one: "
            "connect them to one RealInput, or use AxisWatch.TorqueOffset for a constant torque",
            found[1].origin,
        )
    return FlatInput(found[0].path, TORQUE, origin=found[0].origin) if found else None


def _is_signal(instance: Instance) -> bool:
    return instance.base == "Real" and bool(instance.causality) and not instance.is_parameter


def _measured(group: list[Instance], written: set[str]) -> list[Instance]:
    """Those of connected signals that are the motor torque: one or none."""
    drivers = [i for i in group if _drives(i)]
    if len(drivers) > 1:
        names = " and ".join(i.path for i in drivers)
        raise ModelError(f"{names} are connected, but each of them sets the signal", drivers[1].origin)
    if drivers:
        used = len(group) > 1 or drivers[0].path in written
        return drivers if used and is_given(drivers[0]) else []
    if any(i.path in written for i in group):
        return []
    return _open(group)


def _open(group: list[Instance]) -> list[Instance]:
    """Nothing drives these: right for the torque of a source only."""
    torques = [i for i in group if _kind(i) == "torque"]
    inside = [i for i in group if i.parent is not None and i.causality == "input"]
    if not torques and inside and _kind(inside[0]):
        raise ModelError(f"nothing is connected to {inside[0].path}", inside[0].origin)
    return torques[:1]


def _drives(signal: Instance) -> bool:
    out = _kind(signal) != "" and signal.causality == "output"
    return out or _is_model_input(signal)


def is_given(signal: Instance) -> bool:
    """Whether it comes from outside: it is the input, or nothing uses it."""
    return _is_model_input(signal) or _is_source(signal)


def _is_model_input(signal: Instance) -> bool:
    return _is_signal(signal) and signal.causality == "input" and "." not in signal.path


def _is_source(signal: Instance) -> bool:
    return _kind(signal) == SIGNAL_SOURCE


def _kind(signal: Instance) -> str:
    leaf = signal.parent.leaf if signal.parent is not None else None
    return leaf.kind if leaf is not None else ""


def outputs(
    model: Instance, sensors: Iterable[FlatSensor], kinds: dict[str, str], wiring: Wiring
) -> tuple[FlatSensor, ...]:
    """The sensors that the model's outputs are connected to; where it has no such outputs, all sensors."""
    everything = tuple(sensors)
    wanted = {
        wiring.signals.root(i.path)
        for i in model.members.values()
        if _is_signal(i) and i.causality == "output" and i.is_connector
    }
    chosen = tuple(
        s
        for s in everything
        if wiring.signals.root(f"{s.name}.{KINDS[kinds[s.name]].signals_out[0]}") in wanted
    )
    return chosen or everything
