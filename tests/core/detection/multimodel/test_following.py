"""A bank whose axis has nominal values that vary: it is quiet while they are followed, and names faults beside them."""

from functools import cache
from typing import Any

import numpy as np
import pytest

from monitor_core.arrays import Floats
from monitor_core.calibration.fault_trials import run_trials
from monitor_core.calibration.injection import InjectedFault
from monitor_core.calibration.multimodel_thresholds import bank_thresholds
from monitor_core.detection.multimodel import hypothesis_bank
from monitor_core.detection.multimodel.hypothesis import STEP
from monitor_core.detection.multimodel.hypothesis_bank import HypothesisBank
from monitor_core.detection.multimodel.lanes import lanes_of
from monitor_core.detection.multimodel.multimodel_detector import MultiModelDetector, MultiModelThresholds, guaranteed
from monitor_core.detection.multimodel.naming import CauseIdentified, ChangeDetected
from monitor_core.drive.axis_model import AxisModel
from monitor_core.excitation import multisine
from monitor_core.excitation.reference_experiment import BAND_HZ, TORQUE_RMS
from monitor_core.modeling.standard_drives import INTERVAL_S, REFERENCE_VALUES
from monitor_core.monitoring import AxisMonitor, Fleet
from monitor_core.samples import SampleBlock
from tests.core.calibration.healthy_axes import OUTPUT_NOISE, TORQUE_NOISE, plant_with
from tests.core.simulated import changing_output
from tests.shares import soaked

SECONDS, PIECE = 20, 50
N = round(SECONDS / INTERVAL_S)
T = 1_000_000 + np.arange(N, dtype=np.int64) * round(INTERVAL_S * 1e6)
PLANT = plant_with(0.0)
KT, LOAD, FM = 0, 1, 2


def axis(rng: np.random.Generator, shift: Floats, faults: dict[str, float], at: int) -> tuple[Floats, Floats]:
    """u and y of an axis whose theta is off by ``shift`` (N, p), and from a sample on by these factors, too."""
    u = multisine(rng, N, INTERVAL_S, BAND_HZ, TORQUE_RMS)
    acting, parts = u + TORQUE_NOISE * rng.standard_normal(N), []
    for k in range(0, N, PIECE):
        values = REFERENCE_VALUES | PLANT.model.values(PLANT.model.theta0 + shift[k])
        values |= {name: values[name] * factor for name, factor in faults.items() if k >= at}
        parts.append((values, acting[k : k + PIECE]))
    return u, changing_output(PLANT.model.drive, parts) + OUTPUT_NOISE * rng.standard_normal(N)


def course(column: int, by: float, turns: float = 0.5) -> Floats:
    """A parameter goes away from nominal and back, by a part of its size; or so many times."""
    shift = np.zeros((N, len(PLANT.model.scale)))
    steps = PIECE * (np.arange(N) // PIECE)
    shift[:, column] = by * PLANT.model.scale[column] * np.sin(2 * np.pi * turns * steps / N)
    return shift


@cache
def hypotheses() -> int:
    return len(HypothesisBank(PLANT.model, PLANT.settings).hypotheses)


def bank(samples: float = 720_000.0) -> HypothesisBank:
    return HypothesisBank(PLANT.model, PLANT.settings, h=guaranteed(hypotheses(), samples))


@pytest.mark.parametrize(
    ("column", "by", "turns"),
    soaked([(FM, -0.5, 0.5), (LOAD, 0.3, 10.0)], (LOAD, 0.3, 10.0)),
    ids=["warms up", "reaches out"],
)
def test_what_conditions_do_is_no_fault(column: int, by: float, turns: float, seed: int) -> None:
    """Friction that falls by half with the temperature, a load that depends on the pose: alarms without following."""
    rng = np.random.default_rng(seed)
    shift = course(column, by, turns)
    u, y = axis(rng, shift, {}, N)
    assert not bank().run(SampleBlock(T, u, y, shift=shift))
    assert any(isinstance(event, ChangeDetected) for event in bank().run(SampleBlock(T, u, y)))


def test_a_fault_is_named_beside_what_conditions_do(seed: int) -> None:
    """A torque constant that falls by a quarter where friction is down by half."""
    rng = np.random.default_rng(seed)
    shift, at = course(FM, -0.5), N // 2
    u, y = axis(rng, shift, {"kT": 0.75}, at)
    events = bank().run(SampleBlock(T, u, y, shift=shift))
    named = [event for event in events if isinstance(event, CauseIdentified)]
    print([event.shares[0] for event in events if isinstance(event, ChangeDetected | CauseIdentified)])
    assert T[at] < named[0].time_us < T[at] + 5_000_000
    assert named[0].shares[0].cause == "kT"
    size = named[1].shares[0]  # when it is known better
    assert abs(size.size - np.log(0.75)) < 0.05 + 4 * size.size_sd


def test_steps_too_small_to_be_followed_change_nothing(seed: int) -> None:
    rng = np.random.default_rng(seed)
    u, y = axis(rng, np.zeros((N, 3)), {}, N)
    small = 0.4 * STEP * PLANT.model.scale * np.ones((N, 1))
    samples = SampleBlock(T, u, y)
    (_, plain), (_, moved) = (bank().run_traced(block) for block in (samples, samples._replace(shift=small)))
    assert np.array_equal(plain.g, moved.g, equal_nan=True)


def test_predictors_are_built_once_for_each_position(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also over restarts: a bank of 80 hypotheses takes 15 ms for them, and trials of faults restart it often."""
    rng = np.random.default_rng(seed)
    shift = course(FM, -0.5, 3.0)
    u, y = axis(rng, shift, {}, N)
    samples, built = SampleBlock(T, u, y, shift=shift), list[AxisModel]()

    def counted(model: AxisModel, *args: Any) -> Any:
        built.append(model)
        return lanes_of(model, *args)

    monkeypatch.setattr(hypothesis_bank, "lanes_of", counted)
    used = bank()
    assert not used.run(samples)
    positions = {model.nominal["fm"] for model in built}
    assert 30 < len(built) == len(positions) < 60
    first = used.to_arrays()
    used.reset()
    assert not used.run(samples)
    assert len(built) == len(positions)
    assert {name: a.tobytes() for name, a in used.to_arrays().items()} == {n: a.tobytes() for n, a in first.items()}


def test_a_bank_with_active_faults_becomes_as_new(seed: int) -> None:
    """Predictors around a fault are not those around none."""
    rng = np.random.default_rng(seed)
    u, y = axis(rng, np.zeros((N, 3)), {"kT": 0.75}, N // 4)
    samples, used = SampleBlock(T, u, y), bank()
    expected = used.run(samples)
    assert used.active_faults
    used.reset()
    assert not used.active_faults
    assert repr(used.run(samples)) == repr(expected)


def test_wrong_shapes_are_refused() -> None:
    with pytest.raises(ValueError, match="moved of shape"):
        bank().from_arrays(bank().to_arrays() | {"moved": np.zeros(2)})
    with pytest.raises(ValueError, match="shift of shape"):
        bank().run(SampleBlock(T, np.zeros(N), np.zeros(N), shift=np.zeros((N, 2))))


def test_monitor_and_fleet_hand_them_on(seed: int) -> None:
    """Both detectors of an axis follow the same nominal values."""
    rng = np.random.default_rng(seed)
    shift = course(FM, -0.5, 2.0)
    u, y = axis(rng, shift, {}, N)
    t, shift, u, y = T[: N // 4], shift[: N // 4], u[: N // 4], y[: N // 4]
    assert bank().run(SampleBlock(t, u, y)), "not followed, they alarm"

    def beside() -> MultiModelDetector:
        return MultiModelDetector(PLANT.model, PLANT.settings, MultiModelThresholds(720_000.0))

    assert not AxisMonitor(PLANT.model, PLANT.settings, beside(), "multimodel").update(
        SampleBlock(t, u, y, shift=shift)
    )
    for traced in (False, True):
        fleet = Fleet([PLANT.model], [PLANT.settings], {0: beside()}, {0: "multimodel"})
        assert not fleet.update({0: SampleBlock(t, u, y, shift)}, traced)[0].changes


@pytest.mark.soak
def test_it_is_calibrated_with_records_in_which_they_vary(seed: int) -> None:
    """Followed, thresholds are those of an axis that does not vary, and faults anywhere in the record are found."""
    rng = np.random.default_rng(seed)
    shift, still = course(FM, -0.5), np.zeros((N, 3))
    limits = []
    for moved, known in ((shift, shift), (shift, still), (still, still)):
        u, y = axis(np.random.default_rng(seed), moved, {}, N)
        block = SampleBlock(T, u, y, known, name="r")
        limits.append(bank_thresholds(PLANT.axis, [block], 12_000.0, rng, 40_000).own)
        if moved is known is shift:
            faults = [InjectedFault("kT", 0.4), InjectedFault("kT", -0.4)]
            caught, _ = run_trials(PLANT.axis, block, faults, 6, 5.0, MultiModelThresholds(1.0, limits[0]))
    h = [float(np.median([limit.h for limit in own])) for own in limits]
    allowed = [sum(limit.allowance for limit in own if limit.cause == "fm") for own in limits]
    for what, height, own in zip(("followed", "not", "nothing varies"), h, allowed, strict=True):
        print(f"{what}: h {height:.1f}, allowance of fm {own:.2f}")
    assert h[0] < 1.5 * h[2]
    assert allowed[0] < 1.5 * allowed[2] + 0.05
    assert allowed[1] > allowed[0] + 0.2
    assert all((result.delay_s < 5.0).all() for result in caught)
