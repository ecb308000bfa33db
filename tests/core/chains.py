"""Chains of any number of masses, term by term: a motor, a gear, masses on springs, a weight on the last."""

from typing import Literal

from monitor_core.drive.structure import Drive, Output, Parameter, Quantity, Term
from monitor_core.kernel.tables import COSINE, COULOMB, ONE, SINE, TORQUE

Sensor = Literal["motor", "gear"]
INPUTS = (TORQUE, COULOMB, ONE, COULOMB, COSINE, SINE)
"""Motor torque, friction and offset; friction and weight of the last mass."""


def chain(masses: int, output: Output, sensor: Sensor = "motor", gravity: bool = True) -> Drive:
    """Springs k1, k2 .. and speeds w1, w2 .. as states, then, for the angle, that of the sensor.

    The first spring is at the motor's shaft times the gear ratio r.  A sensor behind the gear has r times the motor's
    angle.  Without gravity the speed may be the output.
    """
    n = 2 * masses - 1
    states = [Quantity(f"deflection{i}", "rad") for i in range(1, masses)]
    states += [Quantity(f"w{i}", "rad/s") for i in range(1, masses + 1)]
    at_motor: dict[str, int] = {} if sensor == "motor" else {"r": 1}
    terms = [*_motions(masses), *_inputs(masses, gravity), *_ratios(sensor, gravity)]
    if output == "angle":
        states.append(Quantity("phi", "rad"))
        terms += [term("A", n, masses - 1, 1, at_motor), term("C", 0, n, 1), term("rest", n, 0, 1)]
    else:
        terms += [term("C", 0, masses - 1, 1, at_motor), *_rigid(masses, sensor)]
    return Drive(
        name=f"{masses} masses",
        output=output,
        states=tuple(states),
        inputs=INPUTS if gravity else INPUTS[:4],
        parameters=tuple(
            Parameter(name, _unit(name), name, _positive(name)) for name in values(masses, gravity)
        ),
        terms=tuple(terms),
        speed_state=masses - 1,
    )


def term(
    matrix: Literal["A", "B", "C", "rest", "ratio"],
    row: int,
    col: int,
    coefficient: float,
    powers: dict[str, int] | None = None,
) -> Term:
    return Term(matrix, row, col, coefficient, tuple(e for e in (powers or {}).items() if e[1]))


def _motions(masses: int) -> list[Term]:
    """Without inputs: the motor's friction, and each spring and damper on the masses before and behind it."""
    speed = masses - 1  # of the first mass
    terms = [term("A", speed, speed, -1, {"f": 1, "J1": -1})]
    for i in range(1, masses):
        r, spring, before, behind = int(i == 1), i - 1, speed + i - 1, speed + i
        terms += [term("A", spring, before, 1, {"r": r}), term("A", spring, behind, -1)]
        for mass, sign, gear in ((before, -1, r), (behind, 1, 0)):
            J = f"J{mass - speed + 1}"
            terms.append(term("A", mass, spring, sign, {f"k{i}": 1, "r": gear, J: -1}))
            terms.append(term("A", mass, before, sign, {f"d{i}": 1, "r": gear + r, J: -1}))
            terms.append(term("A", mass, behind, -sign, {f"d{i}": 1, "r": gear, J: -1}))
    return terms


def _inputs(masses: int, gravity: bool) -> list[Term]:
    first, last, J = masses - 1, 2 * masses - 2, f"J{masses}"
    terms = [term("B", first, c, s, {name: 1, "J1": -1}) for c, s, name in _ON_MOTOR]
    return terms + [term("B", last, c, -1, {name: 1, J: -1}) for c, name in _ON_LAST[: 3 if gravity else 1]]


_ON_MOTOR = ((0, 1, "kT"), (1, -1, "fc"), (2, 1, "tau0"))
_ON_LAST = ((3, "fa"), (4, "gc"), (5, "gs"))


def _ratios(sensor: Sensor, gravity: bool) -> list[Term]:
    """Of the motor's friction and of what acts on the last mass; what is at the sensor has none."""
    if sensor == "gear":
        return [term("ratio", 1, 0, 1, {"r": -1})]
    return [term("ratio", c, 0, 1, {"r": 1}) for c, _ in _ON_LAST[: 3 if gravity else 1]]


def _rigid(masses: int, sensor: Sensor) -> list[Term]:
    motor, rest = (0, 1) if sensor == "motor" else (-1, 0)
    return [term("rest", masses - 1 + i, 0, 1, {"r": rest if i else motor}) for i in range(masses)]


def values(masses: int, gravity: bool = True) -> dict[str, float]:
    """Values on the motor side like those of the reference drive, however many masses share them."""
    r = 0.1
    found = {"J1": 0.006, "f": 0.06, "fc": 0.3, "tau0": 0.1, "kT": 1.0, "r": r, "fa": 0.2 / r}
    for i in range(1, masses):
        found[f"J{i + 1}"] = (0.027 + 0.001 * i) / (masses - 1) / r**2
        found[f"k{i}"] = (12.0 + 3.0 * i) * (masses - 1) / r**2
        found[f"d{i}"] = 0.02 / i * (masses - 1) / r**2
    return found | ({"gc": 0.8 / r, "gs": 0.5 / r} if gravity else {})


def _unit(name: str) -> str:
    if name in {"kT", "r"}:
        return "1"
    if name in {"fc", "fa", "tau0", "gc", "gs"}:
        return "N m"
    return {"J": "kg m^2", "k": "N m/rad"}.get(name[0], "N m s/rad")


def _positive(name: str) -> bool:
    return name[0] in "Jkr"
