"""Outputs that a drive does not have, or that are two of one kind."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.kalman import gains_of_both
from monitor_core.modeling.standard_drives import REFERENCE_VALUES, three_mass
from monitor_core.monitoring.axis_batch import Bank
from monitor_core.monitoring.fleet import Block, Fleet
from monitor_core.settings import Second
from tests.core.both.axes import ANGLE, CASES, PAPER, TORQUE
from tests.core.cases import H


def test_what_does_not_fit_is_refused() -> None:
    case, angle = CASES[0], AxisModel(three_mass("angle"), REFERENCE_VALUES, PAPER)
    s, t, one = case.settings(), np.zeros((2, 1), np.int64), np.zeros((2, 1))
    with pytest.raises(ValueError, match="which the drive does not have"):
        Bank([angle], [s])
    with pytest.raises(ValueError, match="has two outputs and 6 states: need the gains of the second"):
        Bank([case.model], [replace(s, second=None)])
    with pytest.raises(ValueError, match=r"y2 of shape \(2, 1\): need \(2, 1\), of a drive with a second"):
        Bank([angle], [replace(s, second=None)]).run(t, one, one, y2=one)
    with pytest.raises(ValueError, match=r"y2 of shape \(3, 1\): need \(2, 1\)"):
        Bank([case.model], [s]).run(t, one, one, y2=np.zeros((3, 1)))
    with pytest.raises(ValueError, match="axis 0: y2, a second output, which its drive does not have"):
        Fleet([angle], [replace(s, second=None)]).run({0: Block(t[:, 0], one[:, 0], one[:, 0], y2=one[:, 0])})
    with pytest.raises(ValueError, match="has the speed as output: the speed joins an angle"):
        three_mass("speed").with_speed()
    with pytest.raises(ValueError, match="noise of the second output = 0"):
        gains_of_both(case.model, H, TORQUE, ANGLE, 0.0)
    with pytest.raises(ValueError, match="a second output with lam0 = 0"):
        Second((1.0,), 0.0)
