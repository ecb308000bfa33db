"""A payload that an alarm has named: what it changes beside the weight is no second change."""

import numpy as np
import pytest

from monitor_core.arrays import Floats
from monitor_core.detection.cusum.cusum_detector import CusumDetector
from monitor_core.detection.cusum.cusum_evidence import Crossing, Evidence
from monitor_core.detection.isolation import Payload
from monitor_core.detection.onset import Past
from monitor_core.monitoring.alarm_tracker import AlarmTracker

NAMES = ("kT", "fc", "fm", "load")
NOMINAL = np.array([1.0, 2.0, 0.02, 1.0])
PAYLOAD = Payload(3, -NOMINAL, coulomb=(1,))
SD = 0.01 * NOMINAL
STRETCHES = 12


def deviations(friction: float) -> Floats:
    """With 1.1 times the inertia and 1.5 times the weight, and a factor of Coulomb friction."""
    return np.asarray(NOMINAL * np.array([1.0, friction, 1.0, 1.5]) / 1.1 - NOMINAL)


def evidence(time_us: int, d: Floats, payload: Payload) -> Evidence:
    t_us = time_us + np.arange(1 - STRETCHES, 1, dtype=np.int64)
    nothing_learned = Past(t_us, np.zeros((STRETCHES, 4)), np.ones((STRETCHES, 4, 4)), 0.9, 1.0, 0.0)
    found = d, np.diag(SD**2), np.zeros((4, 4))
    return Evidence(time_us, NAMES, *found, 4.2, 1.0, (0,) * 4, nothing_learned, STRETCHES, payload=payload)


def named_after(friction: float, payload: Payload) -> list[str]:
    """The names after a payload was named, and kT and fc have crossed, too."""
    book = AlarmTracker(reopen_us=1000, nameless_us=1000)
    for event in (
        Crossing("load", "up", 10, 5),
        evidence(30, deviations(1.0), payload),
        Crossing("kT", "down", 40, 35),
        evidence(60, deviations(friction), payload),
    ):
        book.update([event], CusumDetector.interpret)
    return [alarm.parameter for alarm in book.open if alarm.stage == "named"]


@pytest.mark.parametrize(("friction", "names"), [(1.0, ["load"]), (1.1, ["load"]), (1.6, ["load", "fc"])])
def test_friction_that_grows_with_the_load_is_no_second_change(friction: float, names: list[str]) -> None:
    """A gear that transmits half as much again has a tenth more friction; six tenths are a fault."""
    assert named_after(friction, PAYLOAD) == names


def test_without_that_it_is_one() -> None:
    assert named_after(1.1, PAYLOAD._replace(coulomb=())) == ["load", "fc"]
