"""What AxisModel makes of the three-mass drive; its entries are in modeling/test_library.py."""

import numpy as np
import pytest

from monitor_core.drive.axis_model import AxisModel
from monitor_core.modeling.standard_drives import reference_model, three_mass

NAMES = ("Jm", "Jg", "Ja", "kg", "ka", "dg", "da", "fm", "fc", "tau0", "kT")
V = dict(zip(NAMES, (2.0, 3.0, 5.0, 7.0, 11.0, 13.0, 17.0, 19.0, 23.0, 29.0, 31.0), strict=True)) | {"r": 0.5}


def test_rest_moves_rigidly() -> None:
    """Without torque and friction nothing accelerates and no spring is tensioned."""
    for output in ("speed", "angle"):
        model = AxisModel(three_mass(output), {**V, "fm": 0.0}, ("kT",))
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
