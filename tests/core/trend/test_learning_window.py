"""New nominal values of repaired axes, of which the truth is known."""

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np
import pytest

from monitor_core.arrays import Floats
from monitor_core.drive import AxisModel
from monitor_core.excitation.reference_experiment import NOISE
from monitor_core.modeling.standard_drives import INTERVAL_S, REFERENCE_VALUES, reference_model
from monitor_core.monitoring import AxisBatch
from monitor_core.trend import PARTS, EstimateReading, KeptReason, LearningWindow, WindowDoubt, WindowError
from monitor_core.trend.learning_window import SKIPPED
from tests.core.honesty import settings_for
from tests.core.simulated import simulated, torques

MODEL = reference_model("speed")
SETTINGS = settings_for("speed", 0.05, 4.0, joint=False)
SPAN_S = SETTINGS.naming_samples * INTERVAL_S
READINGS = PARTS
RHO = math.exp(-3)


def repaired(rng: np.random.Generator, axes: int) -> list[dict[str, float]]:
    """Values of axes whose friction and arm inertia have changed."""
    return [
        {
            **REFERENCE_VALUES,
            "fm": REFERENCE_VALUES["fm"] * rng.uniform(0.7, 1.3),
            "Ja": REFERENCE_VALUES["Ja"] * rng.uniform(0.9, 1.1),
        }
        for _ in range(axes)
    ]


def window_of(values: Mapping[str, float], rng: np.random.Generator) -> LearningWindow:
    """What an axis with these values shows, monitored with the reference values."""
    u = torques(rng, (READINGS + SKIPPED + 11) * SETTINGS.naming_samples, 1)
    rec = simulated(rng, MODEL.drive, u, 0.05, NOISE["speed"], values)
    window = LearningWindow(MODEL, READINGS * SPAN_S)
    for _, event in AxisBatch([MODEL], [SETTINGS]).run(rec.t_us[:, np.newaxis], rec.u, rec.y):
        if isinstance(event, EstimateReading):
            window.take(event)
    return window


def test_the_new_nominal_values_are_the_true_ones_within_their_standard_deviations(seed: int) -> None:
    """Six axes; rms of the 18 values of z: 0.57 to 1.54 with 10 seeds."""
    rng = np.random.default_rng(seed)
    z = []
    for v in repaired(rng, 6):
        window = window_of(v, rng)
        assert window.complete
        found = window.learned()
        assert not found.kept
        truth = np.array([v["kT"], 1 / v["Ja"], v["fm"]])
        z.append((found.theta - truth) / found.standard_deviation)
    assert 0.35 < np.sqrt(np.mean(np.square(z))) < 2.2


def reading(d: Floats, known: Sequence[bool] = (True,) * 3, holds: bool = True) -> EstimateReading:
    """A reading at that deviation, in sizes, each with a standard deviation of one hundredth."""
    value = MODEL.theta0 + d * MODEL.scale
    return EstimateReading(0, tuple(value), tuple((0.01 * MODEL.scale) ** 2), tuple(known), 60.0, RHO, holds)


def filled(of_reading: Callable[[float], EstimateReading], window: LearningWindow | None = None) -> LearningWindow:
    """A window of four hours, with readings at shares of its length."""
    window = window or LearningWindow(MODEL, 240 * 60.0)
    for _ in range(SKIPPED):
        window.take(reading(np.full(3, 9.0)))  # of the axis before, which must not count
    for k in range(240):
        window.take(of_reading(k / 240))
    assert window.complete
    return window


def test_the_mean_is_weighted_with_the_information(seed: int) -> None:
    """Against the same mean written out for the readings."""
    rng = np.random.default_rng(seed)
    given = [reading(0.01 * rng.standard_normal(3)) for _ in range(240)]
    given = [r._replace(variance=tuple(np.array(r.variance) * rng.uniform(1, 9, 3))) for r in given]
    queue = iter(given)
    found = filled(lambda _: next(queue)).learned()
    w = 1 / np.array([r.variance for r in given])
    value = np.array([r.value for r in given])
    parts = [slice(20 * k, 20 * k + 20) for k in range(PARTS)]
    by_part = np.array([(w[p] * value[p]).sum(0) / w[p].sum(0) for p in parts])
    information = np.array([w[p].sum(0) for p in parts])  # all parts have as many readings
    expected = (information * by_part).sum(0) / information.sum(0)
    np.testing.assert_allclose(found.theta, expected, rtol=1e-12)
    assert (found.standard_deviation >= 1 / np.sqrt(information.sum(0))).all()


def test_what_is_not_observed_keeps_its_value_and_is_named() -> None:
    seldom = filled(lambda at: reading(np.array([0.02, 0.3, 0.1]), (True, at < 0.2, False)))
    found = seldom.learned()
    assert found.kept == {"1/Ja": KeptReason.NOT_OBSERVED, "fm": KeptReason.NOT_OBSERVED}
    np.testing.assert_allclose(found.theta, MODEL.theta0 * [1.02, 1, 1])
    assert np.isnan(found.standard_deviation[1:]).all()


def test_a_poor_estimate_keeps_its_value() -> None:
    window = filled(lambda _: reading(np.zeros(3))._replace(variance=tuple((3 * MODEL.scale) ** 2)))
    with pytest.raises(WindowError) as refused:
        window.learned()
    assert refused.value.doubt is WindowDoubt.NOT_OBSERVED


@pytest.mark.parametrize(
    ("of_reading", "doubt", "names"),
    [
        (lambda at: reading(np.array([0, 0, 0.3 * (at > 0.5)])), WindowDoubt.UNSTEADY, ("fm",)),
        (lambda at: reading(np.array([0, 0, 0.2 * (at > 0.85)])), WindowDoubt.UNSTEADY, ("fm",)),
        (lambda at: reading(np.array([0.3 * at, 0, 0])), WindowDoubt.UNSTEADY, ("kT",)),
        (lambda _: reading(np.array([0, 0, 0.8])), WindowDoubt.MOVED, ("fm",)),
        (lambda _: reading(np.zeros(3), (False,) * 3), WindowDoubt.NOT_OBSERVED, MODEL.monitored),
        (lambda at: reading(np.zeros(3), holds=at > 0.6), WindowDoubt.MODEL, ()),
    ],
)
def test_refused_with_the_reason(
    of_reading: Callable[[float], EstimateReading], doubt: WindowDoubt, names: tuple[str, ...]
) -> None:
    with pytest.raises(WindowError) as refused:
        filled(of_reading).learned()
    assert (refused.value.doubt, refused.value.parameters) == (doubt, names)


def test_what_the_thresholds_allow_for_is_no_change() -> None:
    daily = lambda at: reading(np.array([0, 0, 0.06 * math.sin(2 * math.pi * at)]))  # noqa: E731
    with pytest.raises(WindowError):
        filled(daily).learned()
    filled(daily).learned(0.05 * MODEL.scale)


def test_a_delay_is_no_property_of_the_gearbox() -> None:
    drive = MODEL.drive.with_delay()
    model = AxisModel(drive, {**MODEL.nominal, "delay": 0.0}, ("fm", "delay"), {"delay": 1e-3})
    window = LearningWindow(model, 240 * 60.0)
    value = (1.1 * model.theta0[0], 5e-4)
    seen = EstimateReading(0, value, tuple((0.01 * model.scale) ** 2), (True, True), 60.0, RHO)
    found = filled(lambda _: seen, window).learned()
    assert found.kept == {"delay": KeptReason.BY_DEFINITION}
    np.testing.assert_allclose(found.theta, model.theta0 * [1.1, 1])


def test_continues_from_a_saved_state(seed: int) -> None:
    rng = np.random.default_rng(seed)
    given = [reading(0.01 * rng.standard_normal(3)) for _ in range(240 + SKIPPED)]
    straight, first = LearningWindow(MODEL, 240 * 60.0), LearningWindow(MODEL, 240 * 60.0)
    for r in given:
        straight.take(r)
    for r in given[:100]:
        first.take(r)
    second = LearningWindow(MODEL, 240 * 60.0)
    second.from_arrays(first.to_arrays())
    for r in given[100:]:
        second.take(r)
    assert (second.learned().theta == straight.learned().theta).all()
    with pytest.raises(ValueError, match="no learning window"):
        second.from_arrays({**first.to_arrays(), "rho": np.zeros(5)})
