"""Wrong models, settings, samples and saved states are refused, with words that name the thing."""

from dataclasses import replace
from math import inf, nan

import numpy as np
import pytest

from monitor_core.detection import Alarm
from monitor_core.detection.alarm import alarms_to_array
from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.structure import Term
from monitor_core.excitation.reference_experiment import experiment
from monitor_core.kernel.tables import COULOMB, TORQUE
from monitor_core.modeling.standard_drives import MONITORED, REFERENCE_VALUES, reference_model, three_mass
from monitor_core.monitoring import AxisBatch, AxisMonitor
from monitor_core.samples import SampleBlock
from monitor_core.settings import Settings, Threshold

DRIVE = three_mass("speed")
MODEL = reference_model()
SETTINGS = Settings.paper(0.005)


def nominal(**changes: float) -> dict[str, float]:
    return {**REFERENCE_VALUES, **changes}


def test_a_missing_nominal_value() -> None:
    values = nominal()
    del values["Ja"]
    with pytest.raises(KeyError, match=r"no nominal value for Ja \(inertia of the arm, kg m\^2\)"):
        AxisModel(DRIVE, values, MONITORED)


@pytest.mark.parametrize(
    ("values", "monitored", "message"),
    [
        (nominal(Jx=1.0), MONITORED, "Jx"),
        (nominal(), ("kT", "Jx"), "Jx"),
        (nominal(), ("kT", "1/Jx"), "Jx"),
    ],
)
def test_an_unknown_parameter(values: dict[str, float], monitored: tuple[str, ...], message: str) -> None:
    with pytest.raises(KeyError, match=message):
        AxisModel(DRIVE, values, monitored)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("Jm", 0.0, "nominal Jm = 0.0: inertia of the motor must be finite and greater than zero"),
        ("kg", -1.0, "nominal kg = -1.0: stiffness of the gearbox, arm side must be .* greater than zero"),
        ("kT", nan, "nominal kT = nan: torque constant.* must be finite and greater than zero"),
        ("fm", inf, "nominal fm = inf: viscous friction of the motor must be finite$"),
        ("tau0", nan, "nominal tau0 = nan: torque offset must be finite$"),
    ],
)
def test_a_nominal_value_that_makes_no_sense(name: str, value: float, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        AxisModel(DRIVE, nominal(**{name: value}), MONITORED)


@pytest.mark.parametrize("monitored", [("Ja", "1/Ja"), ("kT", "fm", "kT")])
def test_a_parameter_monitored_twice(monitored: tuple[str, ...]) -> None:
    with pytest.raises(ValueError, match="is monitored twice"):
        AxisModel(DRIVE, nominal(), monitored)


@pytest.mark.parametrize("scale", [None, 0.0, -1.0, nan])
def test_a_zero_nominal_value_without_a_scale(scale: float | None) -> None:
    scales = {} if scale is None else {"fc": scale}
    with pytest.raises(ValueError, match=r"fc .*scale|scale of fc"):
        AxisModel(DRIVE, nominal(), ("kT", "fc"), scales)


def test_the_reciprocal_of_zero() -> None:
    with pytest.raises(ValueError, match="1/fc does not exist: its nominal value is 0"):
        AxisModel(DRIVE, nominal(), ("kT", "1/fc"), {"1/fc": 1.0})


@pytest.mark.parametrize("bounds", [(1.1, 0.9), (1.1, 2.0), (0.1, 0.9), (nan, 2.0), (0.5, nan), (0.0, 2.0)])
def test_bounds_that_do_not_hold_the_nominal_value(bounds: tuple[float, float]) -> None:
    with pytest.raises(ValueError, match=r"bounds of kT = .*: need 0 < lower < nominal < upper = 1\.0"):
        AxisModel(DRIVE, nominal(), MONITORED, bounds={"kT": bounds})


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *(("interval_s", v) for v in (0.0, -1.0, inf, nan)),
        *(("lam", v) for v in (0.4, 1.0, 1.1, nan)),
        *(("lam0", v) for v in (0.0, -1.0, inf, nan)),
        *(("alpha1", v) for v in (-1.0, inf, nan)),
        *(("alpha2", v) for v in (0.0, inf, nan)),
        *(("delay_s", v) for v in (-0.001, 0.0051, nan)),
        *(("max_gap_s", v) for v in (0.004, inf, nan)),
        *(("settle_s", v) for v in (-1.0, inf, nan)),
        *(("speed_scale", v) for v in (0.0, inf, nan)),
        ("K", (0.0, nan, 0.0, 0.0, 0.0)),
        ("P0", (1.0, 0.0, 1.0)),
        ("P0", (1.0, inf, 1.0)),
        *(("thresholds", (Threshold(*v),)) for v in ((-1.0, 1.0), (1.0, 0.0), (1.0, 1.0, -0.1), (nan, 1.0))),
    ],
)
def test_settings_out_of_range(name: str, value: float | tuple[float | Threshold, ...]) -> None:
    with pytest.raises(ValueError, match=f"^{name} = .* is out of range"):
        replace(SETTINGS, **{name: value})  # type: ignore[arg-type]


def test_settings_at_the_ends_of_their_ranges() -> None:
    Settings.paper(0.005, lam=0.5, alpha1=0.0, delay_s=0.005, max_gap_s=0.005, settle_s=0.0)


@pytest.mark.parametrize("number", [1, 4, 6])
def test_a_gain_for_another_number_of_states(number: int) -> None:
    with pytest.raises(ValueError, match=f"K has {number} entries, the drive 5 states"):
        AxisBatch([MODEL], [replace(SETTINGS, K=(0.0,) * number)])


def test_P0_for_another_number_of_parameters() -> None:
    with pytest.raises(ValueError, match="P0 has 2 entries, 3 parameters are monitored"):
        AxisBatch([MODEL], [replace(SETTINGS, P0=(1.0, 1.0))])


def test_thresholds_for_another_number_of_parameters() -> None:
    with pytest.raises(ValueError, match="there are 2 thresholds, 3 parameters are monitored"):
        AxisBatch([MODEL], [replace(SETTINGS, thresholds=(Threshold(3.0, 20.0),) * 2)])


def test_a_bank_of_nothing_or_of_unequal_axes() -> None:
    with pytest.raises(ValueError, match="0 models and 0 settings"):
        AxisBatch([], [])
    with pytest.raises(ValueError, match="2 models and 1 settings"):
        AxisBatch([MODEL, MODEL], [SETTINGS])
    for other in (reference_model("angle"), reference_model(monitored=("kT", "fm", "1/Ja"))):
        with pytest.raises(ValueError, match="must share the drive and the monitored parameters"):
            AxisBatch([MODEL, other], [SETTINGS, SETTINGS])


@pytest.mark.parametrize(
    ("t", "u", "y"),
    [((5, 1), (5, 2), (5, 2)), ((5, 2), (4, 2), (5, 2)), ((5, 2), (5, 2), (5,)), ((5,), (5,), (5,))],
)
def test_blocks_of_wrong_shape(t: tuple[int, ...], u: tuple[int, ...], y: tuple[int, ...]) -> None:
    bank = AxisBatch([MODEL] * 2, [SETTINGS] * 2)
    with pytest.raises(ValueError, match=r"need \(N, 2\) each"):
        bank.run(np.zeros(t, np.int64), np.zeros(u), np.zeros(y))


@pytest.mark.parametrize("count", [[5], [5, 6], [-1, 5], [5, 5, 5]])
def test_counts_that_do_not_fit(count: list[int]) -> None:
    bank = AxisBatch([MODEL] * 2, [SETTINGS] * 2)
    with pytest.raises(ValueError, match="need 2 numbers from 0 to 5"):
        bank.run(np.zeros((5, 2), np.int64), np.zeros((5, 2)), np.zeros((5, 2)), np.array(count))


def test_a_saved_state_of_another_model_or_damaged(seed: int) -> None:
    monitor = AxisMonitor(MODEL, SETTINGS)
    monitor.update(SampleBlock(*experiment(seed)))
    arrays = monitor.to_arrays()
    angle = AxisMonitor(reference_model("angle"), SETTINGS)
    with pytest.raises(ValueError, match="does not fit this model"):
        angle.from_arrays(arrays)
    broken = arrays["floats"].astype(float)
    broken[3] = nan
    fresh = AxisMonitor(MODEL, SETTINGS)
    before = [column.copy() for column in fresh.batch.column(0)]
    with pytest.raises(ValueError, match="not finite"):
        fresh.from_arrays({**arrays, "floats": broken})
    with pytest.raises(ValueError, match="no alarms: "):
        fresh.from_arrays({**arrays, "alarms": np.array([[7, 0, 1, 2, 3, 1]])})
    with pytest.raises(KeyError, match="ints"):
        fresh.from_arrays({name: array for name, array in arrays.items() if name != "ints"})
    assert all((a == b).all() for a, b in zip(before, fresh.batch.column(0), strict=True))
    assert fresh.open_alarms == ()
    foreign = Alarm("kg", "up", 1, 2, 3, None, size=1.0, size_sd=1.0, crossings=1)
    fresh.from_arrays({**arrays, "alarms": alarms_to_array([foreign])})
    assert fresh.open_alarms == (), "an alarm of what is no longer monitored is left out"


def test_key_tells_which_states_are_interchangeable() -> None:
    def key(model: AxisModel = MODEL, **changes: float | tuple[float | Threshold, ...]) -> str:
        return AxisMonitor(model, replace(SETTINGS, **changes)).key  # type: ignore[arg-type]

    assert key(alpha1=1.0, alpha2=5.0, P0=(1.0, 1.0, 1.0), max_gap_s=1.0) == key()
    assert key(thresholds=(Threshold(1.0, 2.0),) * 3) == key()
    others = [
        key(lam=0.99),
        key(delay_s=0.001),
        key(K=(0.0, 0.0, 0.1, 0.0, 0.0)),
        key(replace(MODEL, nominal=nominal(fm=0.061))),
        key(reference_model(monitored=("kT", "fm", "1/Ja"))),
        key(reference_model("angle")),
        key(replace(MODEL, drive=replace(DRIVE, terms=(*DRIVE.terms, Term("ratio", 1, 0, 0.5, ()))))),
        key(replace(MODEL, drive=replace(DRIVE, inputs=(TORQUE, COULOMB, TORQUE)))),
        key(speed_scale=0.5),
    ]
    assert key(reference_model()) == key()
    assert len({key(), *others}) == 1 + len(others)
