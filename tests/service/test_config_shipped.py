"""The example configurations load and say what the schema says."""

from pathlib import Path

import pytest

from monitor_core.library import REFERENCE_VALUES
from service.config import load

CONFIG = Path(__file__).resolve().parents[2] / "config"


def test_demo_is_six_reference_drives() -> None:
    config = load(CONFIG / "demo.toml", {})
    assert [axis.id for axis in config.axes] == [f"demo.axis{i}" for i in range(1, 7)]
    expected = {**REFERENCE_VALUES, "fc": 0.08, "tau0": 0.01}
    for axis in config.axes:
        assert axis.config.model.nominal == pytest.approx(expected, rel=1e-14)
        assert axis.config.model.monitor == ("kT", "1/Ja", "fm")
        assert axis.config.output == "angle"
