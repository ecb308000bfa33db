"""The face of the core: every name is there, and importing it loads nothing."""

import ast
import dataclasses
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import monitor_core as mc
from monitor_core.modeling.standard_drives import EXAMPLE_VALUES

SOURCE = Path(mc.__file__).read_text(encoding="utf-8")


@pytest.mark.parametrize("name", mc.__all__)
def test_each_name_is_documented_and_imported(name: str) -> None:
    assert getattr(mc, name) is not None
    assert name in (mc.__doc__ or "")


def test_types_are_those_of_the_imports() -> None:
    """What type checkers see is what programs get."""
    checked = {
        alias.asname or alias.name: (node.module, alias.name)
        for node in ast.walk(ast.parse(SOURCE))
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("monitor_core.")
        for alias in node.names
    }
    assert sorted(checked) == sorted(mc.__all__)
    for name, (module, attribute) in checked.items():
        assert getattr(mc, name) is getattr(sys.modules[str(module)], attribute)


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="has no attribute 'axis_monitor_of'"):
        mc.axis_monitor_of  # noqa: B018


def test_the_import_alone_loads_no_library() -> None:
    code = "import sys, monitor_core; print({m.split('.')[0] for m in sys.modules} & {'numpy', 'numba', 'sympy'})"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert out.strip() == "set()"


def test_a_motion_is_planned_with_the_names_of_the_face(seed: int) -> None:
    drive, values, h = mc.two_mass("angle"), EXAMPLE_VALUES["two-mass"], 0.005
    task = mc.ExcitationTask(
        mc.Plant(drive, values, h),
        mc.Estimation(drive, values, h, lam0=1e-6),
        mc.MotionLimits(torque=2.0, speed=20.0),
        period=400,
        free=("Jm", "fm"),
    )
    planned = mc.plan(task, np.random.default_rng(seed))
    assert max(planned.used.values()) <= 1.0
    assert planned.accuracy.names == ("Jm", "fm")
    with pytest.raises(mc.ExcitationError, match="widen the band"):
        mc.plan(dataclasses.replace(task, band_hz=(1.26, 1.27)), np.random.default_rng(seed))


def test_nominal_values_follow_a_signal_with_the_names_of_the_face() -> None:
    follow = mc.NominalSchedule("fm", mc.Term.read("temperature"), slope=-0.001, reference=40.0)
    operating = mc.Operating(mc.reference_model(), mc.Conditions(("temperature",), (follow,)))
    times, zeros = np.arange(3, dtype=np.int64) * 5000, np.zeros(3)
    block = mc.SampleBlock(times, zeros, zeros, signals=np.array([[40.0], [50.0], [np.nan]]))
    shift = operating.conditioned(block).shift
    assert shift is not None
    assert shift[:2, 2].tolist() == [0.0, -0.001 * 10.0]
