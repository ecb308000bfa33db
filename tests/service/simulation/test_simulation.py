"""The simulated robot: kinds of axes, order of samples, pace, and the signals that it sends."""

import itertools
import math
import threading
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from monitor_core.drive.gates import Gate
from monitor_core.drive.signal_terms import Term
from monitor_core.modeling import EXAMPLE_VALUES
from monitor_core.samples import SampleBlock
from service.can.bus import open_buses
from service.config import NamedAxis, conditions_of
from service.config.axis_settings import AxisError
from service.config.schema import EstimatorConfig, SpeedConfig
from service.pipeline.axes.axis_monitors import AxisMonitors
from service.simulation.axis import SIGNAL_PERIOD_S, ControlledAxis, SimulatedConditions
from service.simulation.robot import Moment, SimulatedFault, SimulatedRobot, run_robot, sender
from tests.service.ingest.plant import axis1, axis2, make_config
from tests.service.pipeline.robots import changed, demo, on_bus
from tests.service.robot_tables import course
from tests.shares import soaked

SPEED_ONLY = {"angle": None, "speed": SpeedConfig(message="Axis1State", signal="Angle")}
OUTPUT_ERROR = {"predictor": "output-error", "output_noise": 0.2, "torque_noise": None}
KINDS: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    "angle": ({}, {}),
    "late torque": ({}, {"torque_delay_s": 0.002}),
    "torque late by a whole interval": ({}, {"torque_delay_s": 0.005}),
    "speed": ({"output_noise": 0.02}, SPEED_ONLY),
    "output error": (OUTPUT_ERROR, SPEED_ONLY),
    "slow samples": ({}, {"sample_interval_s": 0.01, "max_gap_s": 0.1}),
}
"""Changes of the estimator and of the axis"""


@pytest.mark.parametrize("kind", soaked(KINDS, "late torque", "output error"))
def test_the_monitor_of_an_axis_finds_its_nominal_values(kind: str, tmp_path: Path, seed: int) -> None:
    estimator, changes = KINDS[kind]
    (simulated,) = changed(demo(tmp_path, 1), estimator={"initial_p": {}, **estimator}, **changes).axes
    interval_s = simulated.config.sample_interval_s
    u, y = course(simulated, seed, round(40 / interval_s))
    times = np.arange(u.size) * round(interval_s * 1e6)
    assert 0.5 < u.std() < 2.0
    monitors = AxisMonitors([simulated])
    assert monitors.update({simulated.id: SampleBlock(times, u, y)}) == []
    for p in monitors.by_id[simulated.id].status().parameters:
        assert abs(p.estimate - p.nominal) < 0.15 * p.nominal, p.name


def test_axes_of_different_intervals_come_in_the_order_of_time(tmp_path: Path, seed: int) -> None:
    config = changed(demo(tmp_path, 2), "axis2", sample_interval_s=0.012)
    moments = list(itertools.islice(SimulatedRobot(config, seed).moments(), 300))
    times = [m.time_s for m in moments]
    assert times == sorted(times)
    for axis_id, interval_s in (("demo.axis1", 0.005), ("demo.axis2", 0.012)):
        own = [m for m in moments if axis_id in m.readings]
        assert [m.number for m in own] == list(range(len(own)))
        np.testing.assert_allclose([m.time_s for m in own], np.arange(len(own)) * interval_s)


def test_faults_happen_once_and_in_time(tmp_path: Path, seed: int) -> None:
    config = demo(tmp_path, 2)
    faults = [SimulatedFault("demo.axis2", {"fm": 2.0}, 0.5), SimulatedFault("demo.axis1", {"kT": 0.5}, 0.2)]
    happened: list[SimulatedFault] = []
    healthy = SimulatedRobot(config, seed).moments()
    broken = SimulatedRobot(config, seed, faults).moments(happened.append)
    first_difference: dict[str, int] = {}
    for a, b in itertools.islice(zip(healthy, broken, strict=True), 200):
        for axis_id, reading in a.readings.items():
            if reading != b.readings[axis_id]:
                first_difference.setdefault(axis_id, a.number)
    assert happened == [faults[1], faults[0]]
    assert first_difference == {"demo.axis1": 41, "demo.axis2": 101}  # the sample after the fault


def test_a_fault_waits_until_it_may_happen(tmp_path: Path, seed: int) -> None:
    """In the demo, until its detector is compiled."""
    allowed = threading.Event()
    fault = SimulatedFault("demo.axis1", {"fm": 2.0}, 0.1)
    robot = SimulatedRobot(demo(tmp_path, 1), seed, [fault], allowed.is_set)
    happened: list[SimulatedFault] = []
    moments = robot.moments(happened.append)
    assert next(m for m in moments if m.time_s >= 0.2).time_s == pytest.approx(0.2)
    assert happened == []
    allowed.set()
    next(moments)
    assert happened == [fault]


def test_sending_ends_by_time_or_when_told(tmp_path: Path, seed: int) -> None:
    sent: list[float] = []

    def send(moment: Moment) -> int:
        sent.append(moment.time_s)
        return 2

    robot = SimulatedRobot(demo(tmp_path, 1), seed)
    frames, left_out = run_robot(robot, send, threading.Event(), duration_s=0.05)
    assert frames == 2 * len(sent)
    assert len(sent) + left_out == 10
    assert set(sent) <= {k * 0.005 for k in range(10)}
    stop = threading.Event()
    stop.set()
    assert run_robot(robot, send, stop) == (0, 0)


def test_after_a_stall_the_robot_goes_on_in_the_present(tmp_path: Path, seed: int) -> None:
    """Samples that are later than a clock that follows the counter takes are left out, and counted."""
    start, late_s, sent = time.monotonic(), list[float](), list[int]()

    def send(moment: Moment) -> int:
        late_s.append(time.monotonic() - start - moment.time_s)
        sent.append(moment.number)
        if len(sent) == 6:  # not a number of its own: a busy machine may have left that one out
            time.sleep(0.6)
        return 1

    frames, left_out = run_robot(SimulatedRobot(demo(tmp_path, 1), seed), send, threading.Event(), duration_s=2.0)
    assert frames == len(sent)
    assert frames + left_out == 400
    assert sent[6] - sent[5] > 0.6 / 0.005 - 1
    assert min(late_s) >= 0  # nothing is sent before its time


def test_a_bus_inside_the_process_keeps_the_times_of_late_frames(tmp_path: Path, seed: int) -> None:
    """The robot of the demo may be stalled by what else its process does; its samples are not."""
    config = on_bus(demo(tmp_path, 1), options={"preserve_timestamps": True})
    with open_buses(config.bus) as buses, open_buses(config.bus) as listening:
        send = sender(config, buses)

        def stalled(moment: Moment) -> int:
            if moment.number == 3:
                time.sleep(0.1)
            return send(moment)

        frames, left_out = run_robot(
            SimulatedRobot(config, seed), stalled, threading.Event(), duration_s=0.2, latest_s=60.0
        )
        times = [listening["can0"].recv(0) for _ in range(frames)]
    assert left_out == 0
    stamps = np.array([message.timestamp for message in times if message is not None])
    np.testing.assert_allclose(np.unique(stamps) - stamps[0], np.arange(40) * 0.005, atol=1e-6)


# --- signals: they open gates, lie where they are followed, and are what drives follow ----------------------


NOMINAL = {**EXAMPLE_VALUES["three-mass"], "Ja": 96.0, "fc": 0.01, "tau0": 0.01}
SIGNAL = {"message": "Other", "signal": "Something"}


MONITORED = ("fm", "1/Ja")


def axis(
    folder: Path,
    gates: list[dict[str, Any]],
    varying: list[dict[str, Any]],
    monitor: Sequence[str] = MONITORED,
    **signal: Any,
) -> NamedAxis:
    first = axis1(signal=[{"name": "s", **(signal or SIGNAL)}], gate=gates)
    first["model"] = {"monitor": list(monitor), "nominal": NOMINAL, "schedule": varying}
    return make_config(folder, first, axis2()).axes[0]


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
    conditions = SimulatedConditions(axis(tmp_path, [], [slope("fm", "s", 30.0, range=[20.0, 60.0])]))
    course = [conditions.signals(t, {})[0] for t in np.linspace(0, SIGNAL_PERIOD_S, 200)]
    assert (min(course), max(course)) == pytest.approx((22.0, 58.0), abs=0.1)


@pytest.mark.parametrize(("signal", "reference"), [("s", 7.0), ("cos(s)", 0.3), ("sin(s)", -0.2), ("square(s)", 4.0)])
def test_what_has_no_range_is_at_its_reference(signal: str, reference: float, tmp_path: Path) -> None:
    conditions = SimulatedConditions(axis(tmp_path, [], [slope("fm", signal, reference)]))
    values = np.array(conditions.signals(12.3, {}))
    assert Term.read(signal).value({"s": values})[0] == pytest.approx(reference)


def test_the_motion_of_another_axis_is_what_that_sends(tmp_path: Path) -> None:
    named = axis(tmp_path, [], [slope("fm", "s", 0.0)], axis="two", factor=2.0, offset=1.0)
    conditions = SimulatedConditions(named)
    assert conditions.signals(0.0, {"two": 3.0}) == (7.0,)
    assert math.isnan(conditions.signals(0.0, {})[0])


def test_the_acceleration_of_another_axis_is_that_of_what_it_sends(tmp_path: Path) -> None:
    named = axis(tmp_path, [], [slope("fm", "s", 0.0)], axis="two", factor=2.0, acceleration=True)
    conditions, h = SimulatedConditions(named), 0.005
    found = [conditions.signals(k * h, {"two": 1.5 * (k * h) ** 2})[0] for k in range(8)]
    assert found == pytest.approx([math.nan] * 4 + [6.0] * 4, nan_ok=True)


def test_the_acceleration_of_the_axis_itself_is_refused(tmp_path: Path) -> None:
    """It would act one sample late, which makes an inertia that more than doubles unstable."""
    named = axis(tmp_path, [], [slope("fm", "s", 0.0)], axis="one", acceleration=True)
    with pytest.raises(AxisError, match=r"^r.one: its torque offset follows s, the acceleration of the axis itself"):
        SimulatedConditions(named)


def test_a_drive_follows(tmp_path: Path) -> None:
    slopes = [slope("fm", "s", 1.0), {**slope("Ja", "s", 1.0), "slope": 10.0}]
    conditions = SimulatedConditions(axis(tmp_path, [], slopes))
    found = dict(conditions.followed(0.0, 0.0, (3.0,), NOMINAL))
    assert found == pytest.approx({"fm": 0.062, "Ja": 116.0})
    broken = dict(conditions.followed(0.0, 0.0, (3.0,), {**NOMINAL, "fm": 0.1}))
    assert broken["fm"] == pytest.approx(0.102)
    assert dict(conditions.followed(0.0, 0.0, (1.0,), NOMINAL)) == {}
    assert dict(conditions.followed(0.0, 0.0, (math.nan,), NOMINAL)) == {}


def test_a_load_acts_on_the_weight_alone(tmp_path: Path) -> None:
    weight = {**slope("tau0", "cos(s)", 0.5), "slope": -0.4}
    conditions = SimulatedConditions(axis(tmp_path, [], [weight], ["fm", "load"]))
    constant = NOMINAL["tau0"] + 0.4 * 0.5
    assert dict(conditions.followed(0.0, 0.0, (0.0,), NOMINAL))["tau0"] == pytest.approx(constant - 0.4)
    conditions.load = 1.3
    assert dict(conditions.followed(0.0, 0.0, (0.0,), NOMINAL))["tau0"] == pytest.approx(constant - 1.3 * 0.4)
    assert dict(conditions.followed(0.0, 0.0, (math.pi / 2,), NOMINAL))["tau0"] == pytest.approx(constant)


def test_a_heavier_load_of_the_simulated_axis_is_what_its_monitor_estimates(tmp_path: Path, seed: int) -> None:
    weight = {**slope("tau0", "cos(s)", 0.5), "slope": -0.4}
    named = axis(tmp_path, [], [weight], ["fm", "load"])
    noises = EstimatorConfig(torque_noise=0.05, output_noise=1e-4)
    named = named._replace(config=named.config.model_copy(update={"estimator": noises}))
    robot = ControlledAxis(named, np.random.default_rng(seed))
    robot.break_down({"load": 1.3})
    readings = [robot.sample(k) for k in range(5000)]
    u, y = (np.array([getattr(r, name) for r in readings]) for name in ("torque", "motion"))
    signals = np.array([r.signals for r in readings])
    monitors = AxisMonitors([named])
    times = np.arange(5000) * round(robot.interval_s * 1e6)
    monitors.update({named.id: SampleBlock(times, u, y, signals=signals)})
    (estimate,) = (p.estimate for p in monitors.by_id[named.id].status().parameters if p.name == "load")
    assert estimate == pytest.approx(1.3, abs=0.06)
    with pytest.raises(KeyError, match="load"):
        ControlledAxis(axis(tmp_path, [], []), np.random.default_rng(seed)).break_down({"load": 1.3})
