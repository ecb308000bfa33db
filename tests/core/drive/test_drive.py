"""Drives whose parameters are merged from what was drawn, ratios, names of reciprocals; models of the three masses.

The entries of the three-mass drive are in modeling/test_library.py.
"""

import math
from dataclasses import replace

import numpy as np
import pytest

from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.friction_roles import friction_of
from monitor_core.drive.parameter_names import split_name
from monitor_core.drive.structure import Definition, Drive, MatrixTerm, Output, Parameter, Quantity
from monitor_core.kernel.tables import COSINE, COULOMB, ONE, SINE, TORQUE
from monitor_core.modeling.simulated_axis import SimulatedAxis, simulate_linear
from monitor_core.modeling.standard_drives import REFERENCE_VALUES, reference_model, three_mass

JOINED = "Jm + r^2*Jg"
IN_SERIES = "1/k1 + 1/k2"
DRAWN = tuple(
    Parameter(name, unit, f"the {name}", positive)
    for name, unit, positive in (
        ("Jm", "kg m^2", True),
        ("Jg", "kg m^2", True),
        ("r", "1", False),
        ("k1", "N m/rad", True),
        ("k2", "N m/rad", True),
        ("kT", "1", True),
        ("d", "N m s/rad", False),
    )
)
SPRUNG = Drive(
    name="sprung",
    output="speed",
    states=(Quantity("phi", "rad"), Quantity("phi'", "rad/s")),
    inputs=(TORQUE,),
    parameters=(
        Parameter(JOINED, "kg m^2", "inertia"),
        Parameter(IN_SERIES, "rad/(N m)", "compliance"),
        Parameter("kT", "1", "torque constant"),
    ),
    terms=(
        MatrixTerm("A", 0, 1, 1.0, ()),
        MatrixTerm("A", 1, 0, -1.0, ((IN_SERIES, -1), (JOINED, -1))),
        MatrixTerm("B", 1, 0, 1.0, (("kT", 1), (JOINED, -1))),
        MatrixTerm("C", 0, 1, 1.0, ()),
    ),
    speed_state=1,
    definitions=(
        Definition("r^2*Jg", ((1.0, (("r", 2), ("Jg", 1))),)),
        Definition(JOINED, ((1.0, (("Jm", 1),)), (1.0, (("r^2*Jg", 1),)))),
        Definition(IN_SERIES, ((1.0, (("k1", -1),)), (1.0, (("k2", -1),)))),
    ),
    drawn=DRAWN,
)
VALUES = {"Jm": 2.0, "Jg": 3.0, "r": 0.5, "k1": 4.0, "k2": 8.0, "kT": 7.0}
COMPLETE = {JOINED: 2.75, IN_SERIES: 0.375, "kT": 7.0}


def test_merged_parameters_come_from_what_was_drawn() -> None:
    model = AxisModel(SPRUNG, VALUES, (JOINED, IN_SERIES))
    assert model.nominal == COMPLETE
    assert (model.theta0 == [2.75, 0.375]).all()
    A, B, _ = model.matrices([5.0, 0.5])
    assert (A[1, 0], B[1, 0]) == pytest.approx((-1 / 0.5 / 5.0, 7.0 / 5.0), rel=1e-15)
    assert replace(model, monitored=("kT",)).nominal == COMPLETE


def test_a_merged_parameter_may_be_given_itself() -> None:
    assert AxisModel(SPRUNG, COMPLETE, ()).nominal == COMPLETE
    assert AxisModel(SPRUNG, {**VALUES, JOINED: 9.0}, ()).nominal == {**COMPLETE, JOINED: 9.0}
    without = {"k1": 4.0, "k2": 8.0, "kT": 7.0, JOINED: 9.0}
    assert AxisModel(SPRUNG, without, ()).nominal == {**COMPLETE, JOINED: 9.0}


@pytest.mark.parametrize("missing", sorted(VALUES))
def test_a_missing_value_is_named_as_it_was_drawn(missing: str) -> None:
    values = {name: v for name, v in VALUES.items() if name != missing}
    merged = {"kT": ""}.get(missing, IN_SERIES if missing.startswith("k") else JOINED)
    with pytest.raises(KeyError) as refusal:
        AxisModel(SPRUNG, values, ())
    message = refusal.value.args[0]
    assert message.startswith(f"no nominal value for {missing} (")
    assert message.endswith(f", which {merged} is made of" if merged else ")")


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("Jm", f"Jm occurs only in {JOINED}: monitor that"),
        ("1/Jg", f"Jg occurs only in {JOINED}: monitor that"),
        ("r", f"r occurs only in {JOINED}: monitor that"),
        ("d", "d has no effect on what is measured in the drive 'sprung'"),
        ("Jx", f"the drive 'sprung' has no parameter 'Jx'; it has {JOINED}, {IN_SERIES}, kT"),
        ("r^2*Jg", "the drive 'sprung' has no parameter 'r^2*Jg'; it has"),
        (f"1/{JOINED}", f"the drive 'sprung' has no parameter '1/{JOINED}'"),
    ],
)
def test_what_cannot_be_monitored(name: str, message: str) -> None:
    with pytest.raises(KeyError) as refusal:
        AxisModel(SPRUNG, VALUES, (name,))
    assert refusal.value.args[0].startswith(message)


@pytest.mark.parametrize(
    ("changes", "error", "message"),
    [
        *(({name: 1.0}, KeyError, ".*has no parameter") for name in ("Jx", "1/kT", "r^2*Jg")),
        ({"k1": 0.0}, ValueError, "nominal k1 = 0.0: the k1 must be finite and greater than zero"),
        ({"r": math.inf}, ValueError, "nominal r = inf: the r must be finite"),
        ({"r": 1e200}, ValueError, r"r\^2\*Jg has no finite value at Jg = 3.0, r = 1e\+200"),
        (
            {"Jg": 1e308, "r": 10.0},
            ValueError,
            r"nominal Jm \+ r\^2\*Jg = inf: inertia must be finite and greater",
        ),
        ({JOINED: -1.0}, ValueError, r"nominal Jm \+ r\^2\*Jg = -1.0: inertia must be"),
        ({"d": math.nan}, ValueError, "nominal d = nan: the d must be finite"),
    ],
)
def test_values_that_cannot_be_given(changes: dict[str, float], error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=f"^{message}" if error is ValueError else message):
        AxisModel(SPRUNG, {**VALUES, **changes}, ())


def test_a_definition_that_divides_by_zero() -> None:
    drive = replace(SPRUNG, drawn=tuple(replace(p, positive=False) for p in DRAWN))
    with pytest.raises(ValueError, match=r"1/k1 \+ 1/k2 has no finite value at k1 = 0\.0, k2 = 8\.0"):
        AxisModel(drive, {**VALUES, "k1": 0.0}, ())


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("Ja", ("Ja", False)),
        ("1/Ja", ("Ja", True)),
        ("1/ Ja", ("Ja", True)),
        ("1/motor.J", ("motor.J", True)),
        ("1/(Jm + r^2*Jg)", ("Jm + r^2*Jg", True)),
        ("1/(a + b) + 1/(c + d)", ("1/(a + b) + 1/(c + d)", False)),
        ("1/k1 + 1/k2", ("1/k1 + 1/k2", False)),
        ("1/(1/k1 + 1/k2)", ("1/k1 + 1/k2", True)),
        ("1/(a", ("1/(a", False)),
    ],
)
def test_names_of_reciprocals(name: str, expected: tuple[str, bool]) -> None:
    assert split_name(name) == expected


def test_a_reciprocal_of_a_merged_parameter() -> None:
    model = AxisModel(SPRUNG, VALUES, (f"1/({JOINED})",))
    assert (model.theta0 == [1 / 2.75]).all()
    assert model.values([0.2])[JOINED] == 5.0
    assert [(p.name, p.unit) for p in model.parameters] == [(f"1/({JOINED})", "1/(kg m^2)")]


def test_ratios_are_one_at_the_sensor_and_nothing_without_motion() -> None:
    drive = three_mass("angle")
    assert (drive.matrix("ratio", REFERENCE_VALUES)[:, 0] == [0, 1, 0]).all()
    geared = replace(
        drive,
        inputs=(TORQUE, COULOMB, ONE, COSINE, SINE, COULOMB),
        terms=(
            *drive.terms,
            MatrixTerm("ratio", 3, 0, 2.0, (("r", 1),)),
            MatrixTerm("ratio", 3, 0, 1.0, ()),
            MatrixTerm("ratio", 5, 0, 0.0, ()),
        ),
    )
    ratio = geared.matrix("ratio", {**REFERENCE_VALUES, "r": 0.25})
    assert ratio.shape == (6, 1)
    assert (ratio[:, 0] == [0, 1, 0, 1.5, 1, 0]).all()


@pytest.mark.parametrize("kind", [COSINE, SINE])
def test_gravity_needs_the_angle(kind: int) -> None:
    outputs: tuple[Output, ...] = ("speed", "angle")
    for output in outputs:
        drive = three_mass(output)
        drive = replace(drive, inputs=(*drive.inputs, kind))
        if output == "speed":
            with pytest.raises(ValueError, match=r"^gravity depends on the angle: measure the angle$"):
                AxisModel(drive, REFERENCE_VALUES, ("kT",))
        else:
            assert AxisModel(drive, REFERENCE_VALUES, ("kT",)).matrices()[1].shape == (6, 4)


def test_friction_needs_the_speed_at_the_sensor() -> None:
    drive = replace(three_mass("angle"), speed_state=-1)
    with pytest.raises(ValueError, match=r"Coulomb friction depends on the speed.*: measure the speed"):
        AxisModel(drive, REFERENCE_VALUES, ("kT",))
    AxisModel(replace(three_mass("speed"), speed_state=-1), REFERENCE_VALUES, ("kT",))
    terms = tuple(t for t in drive.terms if (t.matrix, t.col) not in {("B", 1), ("B", 2)})
    AxisModel(replace(drive, inputs=(TORQUE,), terms=terms), REFERENCE_VALUES, ("kT",))


def test_a_plant_whose_drawn_parameters_change() -> None:
    def stiff(axis: SimulatedAxis) -> float:
        """Speed after a jerk so short that the spring does not matter: torque over inertia."""
        before = axis.speed
        return (axis.step(1.0, 1e-9)[1] - before) / 1e-9

    axis = SimulatedAxis(VALUES, drive=SPRUNG)
    assert stiff(axis) == pytest.approx(7 / 2.75, rel=1e-6)
    axis.set({"Jm": 4.0})
    assert stiff(axis) == pytest.approx(7 / 4.75, rel=1e-6)
    axis.set({JOINED: 14.0})
    assert stiff(axis) == pytest.approx(7 / 14, rel=1e-6)
    axis.set({"Jm": 2.0})
    assert stiff(axis) == pytest.approx(7 / 2.75, rel=1e-6)
    assert axis.values == VALUES


def test_a_linear_simulation_takes_drawn_parameters(seed: int) -> None:
    u = np.random.default_rng(seed).standard_normal((20, 2))
    y, _ = simulate_linear(SPRUNG, VALUES, u, 0.1)
    assert (y == simulate_linear(SPRUNG, COMPLETE, u, 0.1)[0]).all()
    assert abs(y[-1]).min() > 0


# --- What AxisModel makes of the three-mass drive ---------------------------------------------------------------------


NAMES = ("Jm", "Jg", "Ja", "kg", "ka", "dg", "da", "fm", "fc", "tau0", "kT")
PRIMES = (2.0, 3.0, 5.0, 7.0, 11.0, 13.0, 17.0, 19.0, 23.0, 29.0, 31.0)
V = {**REFERENCE_VALUES, **dict(zip(NAMES, PRIMES, strict=True)), "r": 0.5}


def test_rest_moves_rigidly() -> None:
    """Without torque and friction nothing accelerates and no spring is tensioned."""
    for output in ("speed", "angle"):
        drive = three_mass(output)
        model = AxisModel(drive, {**V, **dict.fromkeys(friction_of(drive).viscous, 0.0)}, ("kT",))
        A, _, C = model.matrices()
        rest = model.drive.matrix("rest", model.nominal)
        assert (C @ rest == 1).all()
        assert abs(A @ rest).max() < 1e-12


def test_theta_of_reciprocals() -> None:
    model = AxisModel(three_mass("speed"), V, ("1/Ja", "fm"))
    assert model.theta0 == pytest.approx([0.2, 19])
    values = model.values([0.25, 20.0])
    assert (values["Ja"], values["fm"], values["kT"]) == (4.0, 20.0, 31.0)
    assert model.matrices([0.25, 20.0])[0][4, 1] == pytest.approx(11 / 4)
    assert [p.unit for p in model.parameters] == ["1/(kg m^2)", "N m s/rad"]
    assert [p.name for p in model.parameters] == ["1/Ja", "fm"]


def test_scales_and_limits() -> None:
    values = {**V, "tau0": 0.0, "fm": -2.0}
    model = AxisModel(three_mass("speed"), values, ("kT", "fm", "tau0"), {"tau0": 0.3}, {"fm": (-5, -1)})
    assert model.scale == pytest.approx([31, 2, 0.3])
    assert model.limits[0] == pytest.approx([3.1, -5, -3])
    assert model.limits[1] == pytest.approx([310, -1, 3])


def test_balance_brings_the_norm_of_the_reference_drive_down() -> None:
    model = reference_model()
    A = model.matrices()[0]
    d = model.balance()
    assert (np.log2(d) == np.round(np.log2(d))).all()
    balanced = A / d[:, np.newaxis] * d
    assert abs(balanced).sum(axis=1).max() < 1e-2 * abs(A).sum(axis=1).max()
