"""What a simulated robot sends opens its gates, lies where it is followed, and is what its drives follow."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from monitor_core.drive.operating_conditions import Gate, Term
from service.config import NamedAxis, conditions_of
from service.simulation.simulated_conditions import PERIOD_S, SimulatedConditions
from tests.service.ingest.plant import axis1, axis2, make_config

VALUES = {"kT": 1.0, "fm": 0.06, "Jm": 0.006, "Jg": 280.0, "Ja": 96.0, "kg": 3e5, "ka": 3e5, "dg": 870.0}
NOMINAL = {**VALUES, "da": 140.0, "fc": 0.01, "tau0": 0.01, "r": 0.0085}
SIGNAL = {"message": "Other", "signal": "Something"}


def axis(
    folder: Path, gates: list[dict[str, Any]], varying: list[dict[str, Any]], **signal: Any
) -> NamedAxis:
    one = axis1(signal=[{"name": "s", **(signal or SIGNAL)}], gate=gates)
    one["model"] = {"monitor": ["fm", "1/Ja"], "nominal": NOMINAL, "schedule": varying}
    return make_config(folder, one, axis2()).axes[0]


@pytest.mark.parametrize(
    "gates",
    [
        [{"equals": [3.0, 4.0]}],
        [{"above": 2.0}],
        [{"below": -2.0}],
        [{"above": 2.0}, {"below": 2.5}],
        [{"equals": [1.0, 7.0]}, {"above": 5.0}],
    ],
)
def test_gates_are_open(gates: list[dict[str, Any]], tmp_path: Path) -> None:
    named = axis(tmp_path, [{"signal": "s", **gate} for gate in gates], [])
    (value,) = SimulatedConditions(named).signals(12.3, {})
    opened: tuple[Gate, ...] = conditions_of(named).gates
    assert all(gate.open(np.array([value])).all() for gate in opened)


def slope(parameter: str, signal: str, reference: float, **more: Any) -> dict[str, Any]:
    return {"parameter": parameter, "signal": signal, "slope": 0.001, "reference": reference, **more}


def test_what_is_followed_swings_within_its_range(tmp_path: Path) -> None:
    one = SimulatedConditions(axis(tmp_path, [], [slope("fm", "s", 30.0, range=[20.0, 60.0])]))
    course = [one.signals(t, {})[0] for t in np.linspace(0, PERIOD_S, 200)]
    assert (min(course), max(course)) == pytest.approx((22.0, 58.0), abs=0.1)


@pytest.mark.parametrize(
    ("signal", "reference"), [("s", 7.0), ("cos(s)", 0.3), ("sin(s)", -0.2), ("square(s)", 4.0)]
)
def test_what_has_no_range_is_at_its_reference(signal: str, reference: float, tmp_path: Path) -> None:
    one = SimulatedConditions(axis(tmp_path, [], [slope("fm", signal, reference)]))
    values = np.array(one.signals(12.3, {}))
    assert Term.read(signal).value(values)[0] == pytest.approx(reference)


def test_the_motion_of_another_axis_is_what_that_sends(tmp_path: Path) -> None:
    named = axis(tmp_path, [], [slope("fm", "s", 0.0)], axis="two", factor=2.0, offset=1.0)
    one = SimulatedConditions(named)
    assert one.signals(0.0, {"two": 3.0}) == (7.0,)
    assert math.isnan(one.signals(0.0, {})[0])


def test_a_drive_follows(tmp_path: Path) -> None:
    slopes = [slope("fm", "s", 1.0), {**slope("Ja", "s", 1.0), "slope": 10.0}]
    one = SimulatedConditions(axis(tmp_path, [], slopes))
    found = dict(one.followed((3.0,), NOMINAL))
    assert found == pytest.approx({"fm": 0.062, "Ja": 116.0})
    broken = dict(one.followed((3.0,), {**NOMINAL, "fm": 0.1}))
    assert broken["fm"] == pytest.approx(0.102)
    assert dict(one.followed((1.0,), NOMINAL)) == {}
    assert dict(one.followed((math.nan,), NOMINAL)) == {}
