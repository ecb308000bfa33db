"""An arm with an unknown payload, and with drives that fail: the load is named where it is that, and no fault is.

Nominal values, noises and thresholds are those that ``identify`` and ``calibrate`` found in records of the arm, as
tests/soak/test_payload.py has them found for arms with other values.
"""

from __future__ import annotations

import copy
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pytest

from monitor_core.detection import PAYLOAD_WITHIN_S, Alarm, Cause, same_payload
from monitor_core.drive import AxisModel, Conditions, NominalSchedule, Operating, Term
from monitor_core.monitoring import AxisMonitor, MonitoringOptions, recommended_settings
from monitor_core.samples import SampleBlock
from monitor_core.settings import Settings, Threshold
from tests.core.arm import AXES, INTERVAL_S, Arm, ArmSamples, ArmTruth, R
from tests.core.chains import one_mass

MONITORED = ("kT", "fm", "fc", "load")
MEMORY_S, MIN_SPEED = 10.0, 3.0
SEED_S, HEALTHY_S = 200.0, 200.0
WATCH_S = 400.0
"""fm +50 % of the elbow is raised after 84 to 214 s: the weights alone leave the coupling of the axes to the noise."""


class Found(NamedTuple):
    """What was found for an axis; ``weight``: terms, slopes, ranges."""

    J: float
    fm: float
    fc: float
    tau0: float
    weight: tuple[tuple[str, float, float, float], ...]
    noise: tuple[float, float, float]  # torque, output, lambda_0
    thresholds: tuple[Threshold, ...]


SHOULDER = Found(
    0.006520848127,
    0.003754260099,
    0.3137609842,
    -0.00118591224,
    (("cos(q2)", -1.277119898, 0.006319, 1.0), ("cos(q2 + q3)", -0.6476650605, -0.59966, 1.0)),
    (0.07176129143, 2.250460132e-05, 1.827131867e-06),
    (
        Threshold(1.680654574, 599.2389629, 0.0, 0.002986584442),
        Threshold(1.134185389, 2425.446268, 0.007079279516, 0.03451224991),
        Threshold(1.084463816, 1124.469533, 0.009650546246, 0.02342430266),
        Threshold(1.608069783, 602.028487, 0.0, 0.002946340656),
    ),
)
ELBOW = Found(
    0.002990687477,
    0.001409037099,
    0.1042051995,
    0.008737072096,
    (("cos(q2 + q3)", -0.6340941972, -0.59966, 1.0),),
    (0.0496359882, 2.184635941e-05, 5.411978617e-06),
    (
        Threshold(1.030034414, 1057.017155, 0.01914745645, 0.02875638493),
        Threshold(0.9671343527, 4724.835294, 0.02569249928, 0.07703240732),
        Threshold(0.9114115195, 2189.039317, 0.0, 0.01246731882),
        Threshold(1.002514018, 1092.996736, 0.01549494632, 0.02527351104),
    ),
)


class AxisWatch:
    """The monitor of an axis with what was found for it."""

    def __init__(self, found: Found, monitored: tuple[str, ...]) -> None:
        values = {"kT": 1.0, "J": found.J, "fm": found.fm, "fc": found.fc, "tau0": found.tau0, "load": 1.0}
        model = AxisModel(one_mass("angle").with_load("tau0"), values, monitored)
        self.monitor = AxisMonitor(model, settings(model, found))
        terms = [NominalSchedule("tau0", Term.read(text), slope, 0.0, *ends) for text, slope, *ends in found.weight]
        self._operating = Operating(model, Conditions(("q2", "q3"), (), (), MIN_SPEED, weight=tuple(terms)))

    def take(self, samples: SampleBlock) -> list[Alarm]:
        return [change.alarm for change in self.monitor.update(self._operating.conditioned(samples))]


def settings(model: AxisModel, found: Found) -> Settings:
    torque, output, lam0 = found.noise
    options = MonitoringOptions(
        torque_noise=torque, output_noise=output, innovation_variance=lam0, lam=1 - INTERVAL_S / MEMORY_S
    )
    plain = recommended_settings(model, INTERVAL_S, options)
    own = dict(zip(MONITORED, found.thresholds, strict=True))
    return replace(plain, thresholds=tuple(own[name] for name in model.monitored))


class ArmWatch:
    """The monitors of both axes."""

    def __init__(self, monitored: tuple[str, ...] = MONITORED) -> None:
        founds = zip(AXES, (SHOULDER, ELBOW), strict=True)
        self._monitored = monitored
        self._axes = {axis: AxisWatch(found, monitored) for axis, found in founds}

    def take(self, samples: ArmSamples) -> dict[tuple[str, object], Alarm]:
        """The last form of each alarm that changed."""
        found = dict[tuple[str, object], Alarm]()
        for k, (axis, watch) in enumerate(self._axes.items()):
            block = SampleBlock(samples.t_us, samples.u[:, k], samples.y[:, k], signals=samples.y * R)
            found |= {(axis, alarm.key): alarm for alarm in watch.take(block)}
        return found

    def copy(self) -> ArmWatch:
        """Another one in the same state."""
        other = ArmWatch(self._monitored)
        for axis, watch in self._axes.items():
            other._axes[axis].monitor.from_arrays(watch.monitor.to_arrays())
        return other


@pytest.fixture(scope="module")
def healthy(seed: int) -> tuple[Arm, ArmWatch]:
    """The arm and its monitors, which have found P(0)."""
    return settled(seed, MONITORED)


@pytest.fixture(scope="module")
def weight_not_monitored(seed: int) -> tuple[Arm, ArmWatch]:
    """The same, with monitors that do not estimate the load."""
    return settled(seed, tuple(name for name in MONITORED if name != "load"))


def settled(seed: int, monitored: tuple[str, ...]) -> tuple[Arm, ArmWatch]:
    arm, watch = Arm(ArmTruth(), np.random.default_rng(seed)), ArmWatch(monitored)
    assert not watch.take(arm.take(SEED_S))
    return arm, watch


def after(healthy: tuple[Arm, ArmWatch], changes: dict[str, float], seconds: float = WATCH_S) -> list[Alarm]:
    """All alarms in so many seconds after a change, shoulder first; arm and monitors stay as they are."""
    arm, watch = copy.deepcopy(healthy[0]), healthy[1].copy()
    found = dict[tuple[str, object], Alarm]()
    for _ in range(round(seconds / 10)):
        found |= watch.take(arm.take(10.0, changes))
    print(*found.items(), sep="\n")
    return [alarm for axis in AXES for (of_axis, _), alarm in found.items() if of_axis == axis]


def names(alarms: list[Alarm]) -> list[tuple[str, str, str]]:
    return [(alarm.stage, alarm.parameter, alarm.direction) for alarm in alarms]


def test_a_healthy_arm_is_quiet(healthy: tuple[Arm, ArmWatch]) -> None:
    assert after(healthy, {}, HEALTHY_S) == []


def test_a_heavier_payload_is_a_load_on_both_axes(healthy: tuple[Arm, ArmWatch]) -> None:
    """Each names its own share: payload and forearm are all that the elbow carries, 21 % more, the shoulder 14 %."""
    alarms = after(healthy, {"payload": 1.3})
    assert names(alarms) == [("named", "load", "up")] * 2
    shoulder, elbow = (alarm.size for alarm in alarms)
    assert shoulder == pytest.approx(0.14, abs=0.04)
    assert elbow == pytest.approx(0.21, abs=0.06)
    assert same_payload(alarms[0], [("elbow", alarms[1])]) == ("elbow",)


def test_a_heavier_payload_is_told_by_its_pattern_where_no_load_is_monitored(
    weight_not_monitored: tuple[Arm, ArmWatch],
) -> None:
    """Each axis for itself cannot tell it from a weaker motor; both at once can."""
    alarms = after(weight_not_monitored, {"payload": 1.3})
    assert names(alarms) == [("named", "kT", "down")] * 2
    assert same_payload(alarms[0], [("elbow", alarms[1])]) == ("elbow",)
    assert same_payload(alarms[1], [("shoulder", alarms[0])]) == ("shoulder",)
    (weaker,) = after(weight_not_monitored, {"shoulder kT": 0.8})
    assert (weaker.parameter, weaker.direction) == ("kT", "down")


def test_friction_that_seems_to_grow_with_a_lighter_payload_is_no_second_change(
    weight_not_monitored: tuple[Arm, ArmWatch],
) -> None:
    """Half of the payload: beside kT, which follows the weight, friction seems larger by the same share."""
    alarms = after(weight_not_monitored, {"payload": 0.5})
    assert names(alarms) == [("named", "kT", "up")] * 2
    assert {alarm.doubt for alarm in alarms} == {""}
    assert same_payload(alarms[0], [("elbow", alarms[1])]) == ("elbow",)


@pytest.mark.parametrize(
    ("changes", "parameter", "direction"),
    [
        ({"shoulder kT": 0.8}, "kT", "down"),
        ({"shoulder kT": 1.2}, "kT", "up"),
        ({"elbow fm": 1.5}, "fm", "up"),
    ],
)
def test_a_fault_of_a_drive_is_no_load(
    changes: dict[str, float], parameter: str, direction: str, healthy: tuple[Arm, ArmWatch]
) -> None:
    assert names(after(healthy, changes)) == [("named", parameter, direction)]


@pytest.mark.parametrize(("begin_us", "same"), [(None, True), (290, True), (310, False)])
def test_a_payload_that_was_over_before_another_change_began_is_not_the_same(begin_us: int | None, same: bool) -> None:
    over = Alarm("load", "up", 100, 200, 200, 300, 0.2, 0.01, 1, "named")
    later = Alarm("load", "up", 310, 320, 320, None, 0.2, 0.01, 1, "named", onset_low_us=begin_us)
    assert same_payload(later, [("elbow", over)]) == (("elbow",) if same else ())
    assert same_payload(over, [("shoulder", later)]) == (("shoulder",) if same else ())


@pytest.mark.parametrize(
    ("of_base", "of_arm", "same"),
    [
        ({}, {}, True),
        ({"parameter": "kT"}, {"parameter": "inertia"}, True),
        ({"onset_low_us": 320, "onset_high_us": 400}, {}, True),
        ({"onset_low_us": 321, "onset_high_us": 400}, {}, False),
        ({"onset_low_us": 200, "onset_high_us": 299}, {}, False),
        ({"onset_low_us": None}, {}, False),
        ({}, {"onset_high_us": None}, False),
        ({"kind": "drift"}, {}, False),
        ({}, {"kind": "drift"}, False),
        ({}, {"parameter": "kT", "causes": (Cause("kT", 0.97, ("load",)),)}, False),
        ({}, {"stage": "changed"}, False),
        ({"raised_us": 340 + round(PAYLOAD_WITHIN_S * 1e6)}, {}, True),
        ({"raised_us": 341 + round(PAYLOAD_WITHIN_S * 1e6)}, {}, False),
    ],
)
def test_a_fault_that_begins_with_a_payload_of_other_axes_is_part_of_it(
    of_base: dict[str, Any], of_arm: dict[str, Any], same: bool
) -> None:
    """A base that turns a heavier arm: its friction seems smaller.  The other axis must show it surely."""
    base = Alarm("fc", "down", 310, 340, 340, None, -0.2, 0.01, 1, "named", onset_low_us=300, onset_high_us=330)
    arm = Alarm("load", "up", 310, 340, 340, None, 0.2, 0.01, 1, "named", onset_low_us=300, onset_high_us=320)
    axes = same_payload(replace(base, **of_base), [("elbow", replace(arm, **of_arm))])
    assert axes == (("elbow",) if same else ())


# --- An axis that bears no weight, as the base of an arm: a payload changes its inertia alone -------------------------

BASE = {"kT": 1.0, "J": 0.5, "fm": 1.5, "fc": 2.0, "tau0": 0.0}
TORQUE_SD, ANGLE_SD, BASE_S, SPEED_SCALE = 0.1, 1e-5, 300.0, 0.05


def base_after(seed: int, **factors: float) -> list[Alarm]:
    """The alarms of a base with the thresholds of the paper after its values change by these factors."""
    model = AxisModel(one_mass("angle"), BASE, ("kT", "fm", "fc"))
    options = MonitoringOptions(torque_noise=TORQUE_SD, output_noise=ANGLE_SD, friction_speed_scale=SPEED_SCALE)
    monitor = AxisMonitor(model, recommended_settings(model, INTERVAL_S, options))
    rng, N = np.random.default_rng(seed), round(BASE_S / INTERVAL_S)
    t = INTERVAL_S * np.arange(N)
    waves = [(rng.uniform(0.05, 0.6), rng.uniform(0, 2 * np.pi)) for _ in range(8)]
    q = np.sum([np.sin(2 * np.pi * f * t + phase) / f for f, phase in waves], axis=0) / 10
    w = np.gradient(q, INTERVAL_S)
    factor = {name: np.where(t < BASE_S / 2, 1.0, factors.get(name, 1.0)) for name in BASE}
    of_inertia = factor["J"] * BASE["J"] * np.gradient(w, INTERVAL_S)
    friction = factor["fm"] * BASE["fm"] * w + factor["fc"] * BASE["fc"] * np.tanh(w / SPEED_SCALE)
    u = (of_inertia + friction) / factor["kT"] + rng.normal(0, TORQUE_SD, N)
    y = q + rng.normal(0, ANGLE_SD, N)
    t_us = np.rint(1e6 * (t + 1.0)).astype(np.int64)
    found = {c.alarm.key: c.alarm for c in monitor.update(SampleBlock(t_us, u, y))}
    print(*found.values(), sep="\n")
    return list(found.values())


@pytest.mark.parametrize(
    ("factors", "name", "alike"),
    [
        ({"J": 1.4}, ("named", "kT", "down"), True),
        ({"J": 0.7}, ("named", "kT", "up"), True),
        ({"kT": 0.7}, ("named", "kT", "down"), False),
        ({"fm": 1.5}, ("named", "fm", "up"), False),
        ({"fc": 0.6}, ("named", "fc", "down"), False),
    ],
)
def test_a_larger_inertia_is_one_alarm_of_a_base(
    factors: dict[str, float], name: tuple[str, str, str], alike: bool, seed: int
) -> None:
    """All torques fall in the same proportion: one change, and no fault of the motor that is the same."""
    alarms = base_after(seed, **factors)
    assert names(alarms) == [name]
    assert any("load" in cause.alike for cause in alarms[0].causes) == alike
