"""The weight as an input of the drive: how much of it acts, the load, is estimated and tested like any parameter."""

from dataclasses import replace

import numpy as np
import pytest

from monitor_core.calibration.injection import changed_values, equivalent_load
from monitor_core.detection.multimodel.candidates import candidate_cause
from monitor_core.detection.multimodel.hypothesis_bank import HypothesisBank
from monitor_core.detection.multimodel.isolability import default_hypotheses
from monitor_core.detection.multimodel.naming import CauseIdentified, Share
from monitor_core.drive import LOAD, AxisModel, Conditions, NominalSchedule, Operating, Term
from monitor_core.kernel.tables import ONE, WEIGHT
from monitor_core.modeling.standard_drives import INTERVAL_S, three_mass
from monitor_core.monitoring import AxisBatch, AxisMonitor
from monitor_core.samples import SampleBlock
from tests.core.moving_weight import MODEL, SETTINGS, VALUES, moving
from tests.core.oracle.system import held_over, inputs
from tests.shares import soaked


def first_named(block: SampleBlock, model: AxisModel = MODEL) -> Share:
    """What the multi-model detector names first."""
    events = HypothesisBank(model, SETTINGS, h=20.0).run(block)
    return next(event.shares[0] for event in events if isinstance(event, CauseIdentified))


def test_the_weight_acts_as_its_constant_torque_does() -> None:
    drive = MODEL.drive
    B = drive.matrix("B", {**VALUES, "tau0": 1.0, LOAD: 0.7})
    constant, weight = (drive.inputs.index(kind) for kind in (ONE, WEIGHT))
    np.testing.assert_allclose(B[:, weight], 0.7 * B[:, constant], rtol=1e-12)
    with pytest.raises(ValueError, match="no constant torque fm"):
        three_mass("speed").with_load("fm")


@pytest.mark.parametrize("load", soaked([0.7, 1.3], 1.3))
def test_another_load_is_estimated_and_named_by_both_detectors(load: float, seed: int) -> None:
    block = moving(seed, load)
    monitor = AxisMonitor(MODEL, SETTINGS)
    changes = monitor.update(block)
    names = {(change.alarm.parameter, change.alarm.direction) for change in changes}
    assert names == {(LOAD, "up" if load > 1 else "down")}, changes
    (estimate,) = (p.estimate for p in monitor.status().parameters if p.name == LOAD)
    assert estimate == pytest.approx(load, abs=0.05)
    share = first_named(block)
    assert share.cause == LOAD
    assert np.exp(share.size) == pytest.approx(load, abs=0.05)


@pytest.mark.parametrize("load", soaked([0.6, 1.3, 1.5], 1.5))
def test_a_payload_that_changes_the_inertia_too_is_a_load(load: float, seed: int) -> None:
    """Four times the share by which the weight changes: kT, fm and load all seem to change."""
    changes = AxisMonitor(MODEL, SETTINGS).update(moving(seed, load, inertia=1 + 4 * (load - 1)))
    last = {change.alarm.key: change.alarm for change in changes}
    ((parameter, size),) = ((alarm.parameter, alarm.size) for alarm in last.values())
    assert parameter == LOAD
    assert size == pytest.approx(load - 1, abs=0.05)


UNMONITORED = replace(MODEL, monitored=("kT", "fm"))
"""The load is among what the multi-model detector knows, not among the estimates."""


def test_another_torque_constant_is_no_load(seed: int) -> None:
    block = moving(seed, 1.0, torque_constant=0.8)
    changes = AxisMonitor(MODEL, SETTINGS).update(block)
    assert {change.alarm.parameter for change in changes} == {"kT"}
    assert [first_named(block, model).cause for model in (MODEL, UNMONITORED)] == ["kT", "kT"]


@pytest.mark.parametrize("inertia", soaked([1.0, 1.2, 1.3], 1.0, 1.3))
def test_another_load_is_named_where_it_is_not_monitored(inertia: float, seed: int) -> None:
    """With or without what the payload adds to the inertia."""
    share = first_named(moving(seed, 1.3, inertia=inertia), UNMONITORED)
    assert share.cause == LOAD
    assert np.exp(share.size) == pytest.approx(1.3, abs=0.1)
    change, _ = candidate_cause(UNMONITORED, SETTINGS, LOAD).quantity.change(share.size, share.size_sd)
    assert change == pytest.approx(0.3, abs=0.1)


def test_the_tests_say_that_another_load_looks_like_the_torque_constant(seed: int) -> None:
    """Where it is not monitored; no other parameter is like it."""
    block = moving(seed, 1.4)
    for monitored, alike in ((("kT", "fm"), (LOAD,)), (("kT", "fm", LOAD), ())):
        changes = AxisMonitor(replace(MODEL, monitored=monitored), SETTINGS).update(block)
        causes = [cause for change in changes for cause in change.alarm.causes]
        assert causes
        assert {c.alike for c in causes if c.parameter == "kT"} <= {alike}
        assert {c.alike for c in causes if c.parameter != "kT"} <= {()}
        assert alike in {c.alike for c in causes}


def test_the_predictor_is_moved_by_the_weight_of_each_sample(seed: int) -> None:
    """As a transcription has it, and side by side as alone; nothing is learned meanwhile."""
    block, W = moving(seed, 1.0, 300), 9
    weight = np.asarray(block.weight)
    s = replace(SETTINGS, K=())
    alone = AxisMonitor(MODEL, s)
    alone.update(block._replace(gate=np.zeros(300, np.bool_)))
    x = MODEL.drive.matrix("rest", VALUES)[:, 0] * block.y[0]
    A, B, _ = MODEL.matrices()
    for k in range(1, 300):
        x = held_over(A, B @ inputs(MODEL, block.u[k - 1], block.y[k - 1], weight[k - 1]), x, INTERVAL_S)
    np.testing.assert_allclose(alone.batch.state.x[:, 0], x, rtol=1e-9)
    batch = AxisBatch([MODEL] * W, [s] * W)
    u, y, beside = (np.repeat(v[:, np.newaxis], W, axis=1) for v in (block.u, block.y, weight))
    beside[:, 1:] = 0.0
    times, gate = np.repeat(block.t_us[:, np.newaxis], W, axis=1), np.zeros((300, W), np.bool_)
    batch.run(times, u, y, gate=gate, weight=beside)
    np.testing.assert_array_equal(batch.state.x[:, 0], alone.batch.state.x[:, 0])
    assert (batch.state.x[:, 1] != batch.state.x[:, 0]).any()


def test_an_unknown_weight_is_that_of_before(seed: int) -> None:
    block = moving(seed, 1.0, 2000)
    assert block.weight is not None
    unknown, held = block.weight.copy(), block.weight.copy()
    unknown[500:700], held[500:700] = np.nan, held[499]
    monitors = [AxisMonitor(MODEL, SETTINGS) for _ in range(2)]
    for monitor, weight in zip(monitors, (unknown, held), strict=True):
        monitor.update(block._replace(weight=weight))
    first, second = (monitor.batch.column(0)[0] for monitor in monitors)
    np.testing.assert_array_equal(first, second)


def test_the_weight_of_the_pose_gates_where_it_is_unknown() -> None:
    terms = (
        NominalSchedule("tau0", Term.read("cos(q2)"), -1.2, 0.3, -1.0, 1.0),
        NominalSchedule("tau0", Term.read("payload * cos(q2 + q3)"), -0.1, 0.0),
    )
    operating = Operating(MODEL, Conditions(("q2", "q3", "payload"), weight=terms))
    signals = np.array([[0.0, 0.0, 5.0], [np.pi / 2, 0.0, 5.0], [0.0, np.nan, 5.0]])
    block = SampleBlock(np.arange(3) * 5000, np.zeros(3), np.zeros(3), signals=signals)
    found = operating.conditioned(block)
    assert found.weight is not None
    assert found.gate is not None
    np.testing.assert_allclose(found.weight[:2], [-1.7, 0.0], atol=1e-12)
    assert np.isnan(found.weight[2])
    assert found.gate.tolist() == [True, True, False]
    assert operating.reason == "payload * cos(q2 + q3) is not known"


def test_the_load_is_injected_exactly() -> None:
    load = equivalent_load(MODEL, changed_values(MODEL, LOAD, 0.3))
    assert load is not None
    assert load.factor == pytest.approx(1.0)
    assert load.inputs == {MODEL.drive.inputs.index(WEIGHT): pytest.approx(-0.3)}


def test_the_load_is_a_cause_of_its_own() -> None:
    sizes = [h.size for h in default_hypotheses(MODEL, SETTINGS) if h.cause == LOAD and not h.alike]
    assert min(sizes) < 0 < max(sizes)
