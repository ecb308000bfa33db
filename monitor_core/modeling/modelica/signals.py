"""Signals of a model: the measured motor torque, and the sensors that are outputs."""

from collections.abc import Collection, Iterable, Mapping, Sequence

from monitor_core.kernel.tables import TORQUE
from monitor_core.modeling.components import COMPONENT_KINDS
from monitor_core.modeling.flat import FlatEquation, FlatInput, FlatSensor, ModelError, Origin
from monitor_core.modeling.modelica.library import SIGNAL_SOURCE


class SignalGroups:
    """The signals of a model, in groups that are connected to each other.

    Args:
        causality: "input" or "output" of each signal of the model itself.
        kinds: path of each library component -> its kind.
        places: where each symbol is declared.
    """

    def __init__(self, causality: Mapping[str, str], kinds: Mapping[str, str], places: Mapping[str, Origin]) -> None:
        self._kinds, self._places = kinds, places
        self._inputs = {name for name, sort in causality.items() if sort == "input"}
        self._outputs = {name for name, sort in causality.items() if sort == "output"}
        self._leader = {name: name for name in (*self._inputs, *self._outputs)}
        for path, kind in kinds.items():
            ends: tuple[str, ...] = ("y",) if kind == SIGNAL_SOURCE else ()
            if kind in COMPONENT_KINDS:
                ends = (*COMPONENT_KINDS[kind].signals_in, *COMPONENT_KINDS[kind].signals_out)
            self._leader.update({f"{path}.{end}": f"{path}.{end}" for end in ends})

    def connect(self, left: str, right: str) -> bool:
        """Join two signals; false if they were joined already."""
        a, b = self._root(left), self._root(right)
        self._leader.setdefault(a, a)
        self._leader[b] = a
        return a != b

    def given(self) -> set[str]:
        """Signals that come from outside: inputs of the model, and sources."""
        return self._inputs | {name for name in self._leader if self._kind(name) == SIGNAL_SOURCE}

    def measured_torque(self, own: Sequence[FlatEquation]) -> FlatInput | None:
        """The input that is the motor torque: a source, an input of the model, a torque to which nothing is connected.

        Args:
            own: the equations that the user wrote; a signal in them is not left open.
        """
        written = {name for equation in own for name, _ in equation.terms}
        found = [signal for group in self._groups() for signal in self._measured(group, written)]
        if not found:  # a torque that the user's equations use, but do not set
            found = [signal for group in self._groups() for signal in self._measured(group, ())][:1]
        if len(found) > 1:
            raise ModelError(
                f"{' and '.join(found)} would both be the measured motor torque, but there is only one: "
                "connect them to one RealInput, or use AxisWatch.TorqueOffset for a constant torque",
                self._place(found[1]),
            )
        return FlatInput(found[0], TORQUE, origin=self._place(found[0])) if found else None

    def outputs(self, sensors: Iterable[FlatSensor]) -> tuple[FlatSensor, ...]:
        """The sensors that the model's outputs are connected to; all sensors if there are no such outputs."""
        everything = tuple(sensors)
        wanted = {self._root(name) for name in self._outputs}
        signal = {s.name: f"{s.name}.{COMPONENT_KINDS[self._kinds[s.name]].signals_out[0]}" for s in everything}
        return tuple(s for s in everything if self._root(signal[s.name]) in wanted) or everything

    def _measured(self, group: list[str], written: Collection[str]) -> list[str]:
        """The signals of a connected group that are the motor torque: one or none."""
        drivers = [name for name in group if self._drives(name)]
        if len(drivers) > 1:
            problem = f"{' and '.join(drivers)} are connected, but each of them sets the signal"
            raise ModelError(problem, self._place(drivers[1]))
        if drivers:
            used = len(group) > 1 or drivers[0] in written
            return drivers if used and drivers[0] in self.given() else []
        if any(name in written for name in group):
            return []
        torques = [name for name in group if self._kind(name) == "torque"]
        gains = [name for name in group if self._kind(name) == "gain"]
        if not torques and gains:
            raise ModelError(f"nothing is connected to {gains[0]}", self._place(gains[0]))
        return torques[:1]

    def _drives(self, name: str) -> bool:
        kind = self._kind(name)
        sent = COMPONENT_KINDS[kind].signals_out if kind in COMPONENT_KINDS else ()
        return name in self.given() or name.rpartition(".")[2] in sent

    def _kind(self, name: str) -> str:
        return self._kinds.get(name.rpartition(".")[0], "")

    def _place(self, name: str) -> Origin:
        owner = name.rpartition(".")[0] or name
        return Origin(owner, self._places[name].file, self._places[name].line)

    def _root(self, name: str) -> str:
        while (above := self._leader.get(name, name)) != name:
            name = above
        return name

    def _groups(self) -> list[list[str]]:
        groups: dict[str, list[str]] = {}
        for name in list(self._leader):
            groups.setdefault(self._root(name), []).append(name)
        return list(groups.values())
