"""The role and the axis of a column or a signal, by the words in its name and by its unit."""

import re
from collections.abc import Collection, Hashable, Mapping
from typing import TypeVar

from service.config.unit_names import MeasuredQuantity, current_in, unit_in, without_unit

K = TypeVar("K", bound=Hashable)

_TABLE = """
time: t time times timestamp zeit sec secs seconds s ms us
torque: trq torque torques tau taum moment drehmoment tq nm mot effort couple coppia
current: i cur curr current currents amp strom iq isq courant corrente
angle: pos position positions lage istlage angle angles ang phi q qm theta winkel joint deg rad posizione posicion
speed: vel velo velocity velocities speed spd omega w qd dq qdm dqm qdot rpm drehzahl vitesse velocita velocidad
temperature: temp temps temperature temperatures temperatur temperaturen
wanted: ref reference cmd des set soll target wanted desired command commanded qg setpoint consigne consigna computed
other: error err deviation diff disturb disturbance ff limit limits gravity schleppfehler validity quality
"""
_WORDS = {word: line.partition(":")[0] for line in _TABLE.split("\n") for word in line.split()[1:]}
"""The role that a word in a column's name indicates; "wanted": a command of the controller, not a measurement; "other":
neither, but about a quantity of an axis."""
_ENDINGS = {
    "strom": "current",
    "moment": "torque",
    "momenten": "torque",
    "lage": "angle",
    "winkel": "angle",
    "position": "angle",
    "drehzahl": "speed",
    "geschwindigkeit": "speed",
    "temperatur": "temperature",
}
"""The role that the end of a German word indicates: Motorstrom, Istwinkel, Lageistwert; Sollwinkel is a command."""
_COMMANDED = "soll"
_QUANTITIES: tuple[MeasuredQuantity, ...] = ("torque", "angle", "speed")
NOT_MEASURED = {
    *("input", "limit", "limits", "max", "min", "ff", "error", "err"),
    *("warning", "gain", "config", "offset", "request", "requested", "param"),
}
NO_MOTION = {"status", "mode", "state", "flag", "time"}
"""Applies to the name of the signal only: a message with the state of an axis may also carry its motion."""
MEASURED = {
    *("act", "actual", "measured", "meas", "fb", "feedback"),
    *("ist", "istwert", "estimate", "estimated", "value"),
}
_AXIS = {"axis", "joint", "motor", "drive", "achse", "node", "robot"}
_ANY = {
    *_AXIS,
    *("data", "message", "msg", "signal"),
    *("pdo", "tpdo", "rpdo", "get", "set", "status", "state", "mode", "feed", "back", "filtered", "raw"),
}
"""Words that do not distinguish axes"""


def is_axis(name: str) -> bool:
    """Whether a column has the number of an axis, by its name."""
    words = {*words_in(name)} - {"id", "nr", "no", "number"}
    return bool(words) and words <= _AXIS


def words_in(name: str) -> list[str]:
    """The words of a column's name in lower case: "A1_TrqAct" has a, trq, act, and "AIPos.A1" ai, pos, a."""
    apart = re.sub(r"(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", " ", name)
    return [word.lower() for word in re.findall(r"[A-Za-z]+", apart)]


def role_of(name: str) -> str:
    """The role of a column by its name; empty: not known."""
    words = words_in(name)
    known = [role for word in words if (role := _role_of_word(word))]
    if len(known) < len(words):  # in a longer name, such as PCTRL_S_ACT, a letter is no time
        known = [role for word in words if (role := _role_of_word(word)) and (role != "time" or len(word) > 1)]
    return next((role for role in ("other", "wanted", "temperature") if role in known), known[-1] if known else "")


def _role_of_word(word: str) -> str:
    if word in _WORDS:
        return _WORDS[word]
    stem = re.sub("(soll|ist)(wert)?$", "", word)
    found = next((role for ending, role in _ENDINGS.items() if stem.endswith(ending)), "")
    return "wanted" if found and _COMMANDED in word else found


def desired(names: Collection[str]) -> set[str]:
    """The names that differ from another one by "_d" behind a word only, as q_d from q: what is desired."""
    return {name for name in names if "_d" in name and name.replace("_d", "") in names}


def commanded_role(name: str) -> str:
    """The quantity that a controller commands, by the name of the column; the name has a word for "command"."""
    words = [word.replace(_COMMANDED, "") for word in words_in(name) if _WORDS.get(word) != "wanted"]
    return role_of(" ".join(words))


def role_with(name: str, unit: str) -> str:
    """The role of a column by its name and its unit; the unit may be empty."""
    role = role_of(name)
    if role in ("", "torque") and current_in(unit) is not None:
        return "current"
    known = ((quantity, unit_in(unit, quantity)) for quantity in _QUANTITIES)
    return role or next((q for q, found in known if found is not None and not found.linear), "")


_LOADS = {"payload", "nutzlast", "load", "last", "gewicht", "weight", "mass", "masse"}
_LOAD_UNITS = {"kg", "t", "lb", "lbs", "n", "kn"}


def is_load(name: str, unit: str) -> bool:
    """Whether a column is a measured payload, by its name and unit; a load in per cent is that of a motor."""
    words = {*words_in(without_unit(name))} & _LOADS
    return bool(words) and (unit.lower() in _LOAD_UNITS or (not unit and "payload" in words))


_DEGREES = {"°c", "degc", "celsius", "°f", "degf"}
_GEARS = {"gear", "gearbox", "gears", "getriebe", "reducer"}
_ELECTRONICS = {
    "board",
    "pcb",
    "cpu",
    "controller",
    "inverter",
    "amplifier",
    "umrichter",
    "igbt",
    "heatsink",
    "encoder",
}


def is_temperature(name: str, unit: str) -> bool:
    """Whether a column or signal is a measured temperature, by its name or unit."""
    return role_of(without_unit(name)) == "temperature" or (
        unit.lower() in _DEGREES and not role_of(without_unit(name))
    )


def distance_from_gear(name: str) -> int:
    """Of a temperature, by its name: 0: that of a gear; 1: of a motor, or of nothing named; 2: of electronics."""
    words = {*words_in(without_unit(name))}
    return 0 if words & _GEARS else 2 if words & _ELECTRONICS else 1


def is_of_sensor(name: str) -> bool:
    """Whether a torque is that of a torque sensor, or one that acts from outside, by its name."""
    return bool({*words_in(name)} & {"sensor", "ext", "external"})


_GRIPPERS = {
    "gripper",
    "grip",
    "gripped",
    "greifer",
    "vacuum",
    "vakuum",
    "suction",
    "sauger",
    "clamp",
    "clamped",
}


def is_gripper(name: str) -> bool:
    """Whether a column or signal says, by its name, whether something is gripped."""
    return bool({*words_in(without_unit(name))} & _GRIPPERS)


def own_word(name: str) -> str:
    """The first word of a name that may name the axis, as it describes no quantity or kind of value; empty: none.

    A letter beside "axis" names it, too, such as S and T of the robots whose axes are S, L, U, R, B and T.
    """
    beside = re.search(r"(?<![a-z])([a-z])[ _-]?axis(?![a-z])", name, re.IGNORECASE)
    if beside is not None:
        return beside[1].lower()
    known = _ANY | MEASURED | NOT_MEASURED | NO_MOTION
    return next((w for w in words_in(name) if w not in known and not role_of(w)), "")


def owners(numbers: Mapping[K, str], words: Mapping[K, str], quantities: Mapping[K, str]) -> dict[K, str]:
    """The axis of each column or signal: its number, otherwise its word; empty: none.

    A word, or the letter of a linear axis, distinguishes axes without numbers if both torque and motion have it.

    ``numbers``: axis number in the name, or empty; ``words``: see ``own_word``; ``quantities``: role of each.
    """
    plain = [name for name, number in numbers.items() if not number]
    kinds: dict[str, set[str]] = {}
    for name in plain:
        kinds.setdefault(words[name], set()).add(quantities[name])
    of_both = {word for word, those in kinds.items() if word and "torque" in those and len(those) > 1}
    if len(of_both) + len({number for number in numbers.values() if number}) < 2:
        return dict(numbers)
    return {**numbers, **{name: words[name] for name in plain if words[name] in of_both}}


def axis_name(number: str) -> str:
    """Name of an axis from its number, its letter or its word; "axis" if it has none of these."""
    return number if len(number) > 1 and not number.isdigit() else f"axis{number.upper()}"


def axis_number(name: str) -> str:
    """The axis number in a column's name; empty: none."""
    found = re.findall(r"(?:axis|joint|motor|drive|servo|achse)[ _.\[(]*(\d+)", name, re.IGNORECASE)[:1]
    found = found or re.findall(r"\d+", name)
    return str(found[-1]) if found and not name.isdigit() else ""
