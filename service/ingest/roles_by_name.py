"""What a column or a signal is by the words in its name and by its unit, and which axis it belongs to."""

from __future__ import annotations

import re

from service.ingest.unit_names import Quantity, current_in, unit_in

_TABLE = """
time: t time times timestamp zeit sec secs seconds s ms us
torque: trq torque torques tau moment drehmoment tq nm mot
current: i cur curr current currents amp strom iq
angle: pos position positions lage istlage angle angles ang phi q qm theta winkel joint deg rad
speed: vel velocity velocities speed omega w qd dq qdot rpm drehzahl
temperature: temp temperature temperatur
wanted: ref cmd des set soll target wanted desired command commanded qg setpoint
"""
_WORDS = {word: line.partition(":")[0] for line in _TABLE.split("\n") for word in line.split()[1:]}
"""What a word in a column's name says that it is; wanted: what the controller asks for, which is no measurement."""
_ENDINGS = {
    "strom": "current",
    "moment": "torque",
    "winkel": "angle",
    "position": "angle",
    "drehzahl": "speed",
    "geschwindigkeit": "speed",
    "temperatur": "temperature",
}
"""What the end of a German word says that it is: Motorstrom, Istwinkel; Sollwinkel is what the controller asks for."""
_ASKED = "soll"
_QUANTITIES: tuple[Quantity, ...] = ("torque", "angle", "speed")


def words_in(name: str) -> list[str]:
    """The words of a column's name, small letters: "A1_TrqAct" has a, trq, act."""
    apart = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name)
    return [word.lower() for word in re.findall(r"[A-Za-z]+", apart)]


def role_of(name: str) -> str:
    """What a column is by its name; empty: the name does not tell."""
    known = [role for word in words_in(name) if (role := _role_of_word(word))]
    return "wanted" if "wanted" in known else known[-1] if known else ""


def _role_of_word(word: str) -> str:
    if word in _WORDS:
        return _WORDS[word]
    found = next((role for ending, role in _ENDINGS.items() if word.endswith(ending)), "")
    return "wanted" if found and word.startswith(_ASKED) else found


def role_with(name: str, unit: str) -> str:
    """What a column is by its name and its unit, which may be empty."""
    role = role_of(name)
    if role in ("", "torque") and current_in(unit) is not None:
        return "current"
    known = ((quantity, unit_in(unit, quantity)) for quantity in _QUANTITIES)
    return role or next((q for q, found in known if found is not None and not found.linear), "")


def axis_name(number: str) -> str:
    """Of an axis, by its number, its letter, or the word that tells it from others; empty: it has none of these."""
    return number if len(number) > 1 and not number.isdigit() else f"axis{number.upper()}"


def axis_number(name: str) -> str:
    """The number of the axis in a column's name; empty: there is none."""
    found = re.findall(r"\d+", name)
    return found[-1] if found and not name.isdigit() else ""
