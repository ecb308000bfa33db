"""Wrong models, settings, samples and saved states are refused, with words that name the thing."""

from collections.abc import Sequence
from dataclasses import fields, replace
from math import inf, nan
from typing import Any

import numpy as np
import pytest

from monitor_core.detection import Alarm
from monitor_core.detection.alarm import alarms_to_array
from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.structure import MatrixTerm, Output
from monitor_core.excitation.reference_experiment import experiment
from monitor_core.kernel.tables import COULOMB, TORQUE
from monitor_core.modeling.standard_drives import MONITORED, REFERENCE_VALUES, reference_model, three_mass
from monitor_core.monitoring import AxisBatch, AxisMonitor
from monitor_core.samples import SampleBlock
from monitor_core.settings import Settings, Threshold

DRIVE = three_mass("speed")
MODEL = reference_model()
SETTINGS = Settings.paper(0.005)
BOUNDS = r"bounds of kT = .*: need 0 < lower < nominal < upper = 1\.0"


def nominal(**changes: float) -> dict[str, float]:
    return {**REFERENCE_VALUES, **changes}


WITHOUT_JA = {name: v for name, v in REFERENCE_VALUES.items() if name != "Ja"}


@pytest.mark.parametrize(
    ("values", "monitored", "others", "message"),
    [
        (WITHOUT_JA, MONITORED, {}, r"no nominal value for Ja \(inertia of the arm, kg m\^2\)"),
        (nominal(Jx=1.0), MONITORED, {}, "Jx"),
        *((nominal(), ("kT", name), {}, "Jx") for name in ("Jx", "1/Jx")),
        (nominal(Jm=0.0), MONITORED, {}, "nominal Jm = 0.0: inertia of the motor must be finite and greater than zero"),
        (nominal(kg=-1.0), MONITORED, {}, "nominal kg = -1.0: stiffness of the gearbox, arm side must be .* greater"),
        (nominal(kT=nan), MONITORED, {}, "nominal kT = nan: torque constant.* must be finite and greater than zero"),
        (nominal(fm=inf), MONITORED, {}, "nominal fm = inf: viscous friction of the motor must be finite$"),
        (nominal(tau0=nan), MONITORED, {}, "nominal tau0 = nan: torque offset must be finite$"),
        *((nominal(), m, {}, "is monitored twice") for m in (("Ja", "1/Ja"), ("kT", "fm", "kT"))),
        (nominal(), ("kT", "fc"), {}, r"fc .*scale"),
        *((nominal(), ("kT", "fc"), {"scales": {"fc": v}}, "scale of fc") for v in (0.0, -1.0, nan)),
        (
            nominal(), ("kT", "1/fc"), {"scales": {"1/fc": 1.0}},
            "1/fc does not exist: its nominal value is 0",
        ),
        *(
            (nominal(), MONITORED, {"bounds": {"kT": b}}, BOUNDS)
            for b in ((1.1, 0.9), (1.1, 2.0), (0.1, 0.9), (nan, 2.0), (0.5, nan), (0.0, 2.0))
        ),
    ],
)  # fmt: skip
def test_a_model_that_makes_no_sense(
    values: dict[str, float], monitored: Sequence[str], others: dict[str, Any], message: str
) -> None:
    missing = values is WITHOUT_JA or message == "Jx"
    with pytest.raises(KeyError if missing else ValueError, match=message):
        AxisModel(DRIVE, values, tuple(monitored), **others)


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


@pytest.mark.parametrize(
    ("models", "settings", "message"),
    [
        *(([MODEL], [replace(SETTINGS, K=(0.0,) * n)], f"K has {n} entries, the drive 5 states") for n in (1, 4, 6)),
        ([MODEL], [replace(SETTINGS, P0=(1.0, 1.0))], "P0 has 2 entries, 3 parameters are monitored"),
        (
            [MODEL],
            [replace(SETTINGS, thresholds=(Threshold(3.0, 20.0),) * 2)],
            "there are 2 thresholds, 3 parameters are monitored",
        ),
        ([], [], "0 models and 0 settings"),
        ([MODEL, MODEL], [SETTINGS], "2 models and 1 settings"),
        *(
            ([MODEL, other], [SETTINGS] * 2, "must share the drive and the monitored parameters")
            for other in (reference_model("angle"), reference_model(monitored=("kT", "fm", "1/Ja")))
        ),
    ],
)
def test_a_batch_whose_parts_do_not_fit(models: list[AxisModel], settings: list[Settings], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        AxisBatch(models, settings)


@pytest.mark.parametrize(
    ("t", "u", "y", "others", "message"),
    [
        *(
            (*shapes, {}, r"need \(N, 2\) each")
            for shapes in (((5, 1), (5, 2), (5, 2)), ((5, 2), (4, 2), (5, 2)), ((5, 2), (5, 2), (5,)), ((5,),) * 3)
        ),
        *(
            ((5, 2),) * 3 + ({"count": np.array(n)}, "need 2 numbers from 0 to 5")
            for n in ([5], [5, 6], [-1, 5], [5, 5, 5])
        ),
        ((5, 2), (5, 2), (5, 2), {"shift": np.zeros((5, 1))}, r"shift, gate of shapes \(5, 1\)"),
        ((5, 2), (5, 2), (5, 2), {"gate": np.ones((4, 2), np.bool_)}, r"need \(5, 3, 2\) and \(5, 2\)"),
    ],
)  # fmt: skip
def test_blocks_of_wrong_shape(
    t: tuple[int, ...], u: tuple[int, ...], y: tuple[int, ...], others: dict[str, Any], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        AxisBatch([MODEL] * 2, [SETTINGS] * 2).run(np.zeros(t, np.int64), np.zeros(u), np.zeros(y), **others)


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
        key(replace(MODEL, drive=replace(DRIVE, terms=(*DRIVE.terms, MatrixTerm("ratio", 1, 0, 0.5, ()))))),
        key(replace(MODEL, drive=replace(DRIVE, inputs=(TORQUE, COULOMB, TORQUE)))),
        key(speed_scale=0.5),
    ]
    assert key(reference_model()) == key()
    assert len({key(), *others}) == 1 + len(others)


OTHER_SETTINGS = Settings(
    interval_s=0.004, lam=0.99, lam0=0.5, alpha1=1.0, alpha2=5.0, thresholds=(Threshold(1.0, 2.0),) * 3,
    model_error=(0.1, 0.0, 0.0), K=(0.1, 0.0, 0.0, 0.0, 1e-7), K_after=((0.1, 0.0, 0.0, 0.0, 0.0),) * 11,
    delay_s=0.001, max_gap_s=1.0, settle_s=2.0, lost_s=0.5, speed_scale=0.3, P0=(1.0, 2.0, 3.0), information_floor=0.1,
    min_excitation=0.02, outlier_limit=5.0, largest_error=0.25, joint_state=True, covariance_reset=3.0,
    unidentifiable=(("kT", "fm"),), run_on=True,
)  # fmt: skip
NOT_PART_OF_STATE = {
    "alpha1", "alpha2", "thresholds", "model_error", "max_gap_s", "P0", "outlier_limit", "covariance_reset",
    "unidentifiable", "run_on",
}  # fmt: skip
"""Settings that may change between two runs without making a saved state invalid"""


@pytest.mark.parametrize("name", [field.name for field in fields(Settings)])
def test_each_setting_is_part_of_the_key_or_changes_no_state(name: str) -> None:
    changed = replace(SETTINGS, **{name: getattr(OTHER_SETTINGS, name)})
    assert changed != SETTINGS
    same = AxisMonitor(MODEL, changed).key == AxisMonitor(MODEL, SETTINGS).key
    assert same == (name in NOT_PART_OF_STATE)


def test_the_key_of_the_settings_is_the_same_in_each_version() -> None:
    """Of the version of 2026-11-29.  With another one, an upgrade would lose all checkpoints."""
    gains = ", ".join(["(0.1, 0.0, 0.0, 0.0, 0.0)"] * 11)
    assert AxisMonitor(MODEL, OTHER_SETTINGS).key.endswith(
        " theta=('kT', '1/Ja', 'fm') Settings(interval_s=0.004, lam=0.99, lam0=0.5, alpha1=0.0, alpha2=1.0, "
        f"thresholds=(), model_error=(), K=(0.1, 0.0, 0.0, 0.0, 1e-07), K_after=({gains}), delay_s=0.001, "
        "max_gap_s=0.004, settle_s=2.0, lost_s=0.5, speed_scale=0.3, P0=(), information_floor=0.1, "
        "min_excitation=0.02, outlier_limit=0.0, largest_error=0.25, joint_state=True, covariance_reset=0.0, "
        "unidentifiable=(), run_on=False)"
    )


@pytest.mark.parametrize(
    ("output", "structure"),
    [("speed", "2044ef368d11ce6cfb02a8a5accda32d"), ("angle", "427eda5977731bdcd8cb59508945a13b")],
)
def test_the_keys_of_a_drive_are_the_same_in_each_version(output: Output, structure: str) -> None:
    """Of the version of 2026-11-27.  With other ones, an upgrade would lose all checkpoints and histories."""
    monitor = AxisMonitor(reference_model(output), replace(SETTINGS, K=(0.0,) * (5 if output == "speed" else 6)))
    for key in (monitor.key, monitor.history_key):
        assert f"drive=three-mass/{output}/{structure} [('Ja', 95." in key
