"""Drives and a calibration made by hand: what reports say of them can be told beforehand."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from monitor_core.calibration.budget import Rates
from monitor_core.calibration.fault_trials import TrialResult
from monitor_core.calibration.injection import InjectedFault
from monitor_core.calibration.multimodel_thresholds import BankThresholds
from monitor_core.calibration.result import CalibrationResult, MultiModelCalibration
from monitor_core.calibration.scatter import Scatter
from monitor_core.detection.multimodel.multimodel_detector import HypothesisThreshold
from monitor_core.drive.structure import Output
from monitor_core.modeling.flat import FlatParameter
from monitor_core.modeling.laurent import Laurent
from monitor_core.modeling.statespace import Entries, Report, StateSpace, SymbolicDefinition
from monitor_core.settings import Threshold
from service.config import load
from service.config.axis_settings import axis_settings
from service.config.drive_sources import model_called
from service.config.drives import axis_model
from service.ingest.records.loaded_records import RecordOrigin
from service.reports.calibration_report import Calibration
from service.reports.formats import Provenance
from tests.conftest import ROOT


@cache
def space(output: Output = "speed", name: str = "three-mass") -> StateSpace:
    """The three-mass drive of the paper, with a note and other counts of its elimination."""
    note = "the angle of the whole drive cannot be seen by a speed sensor: it is no state"
    report = Report(flat_equations=71, flat_states=11, remaining_equations=6)
    drawn = model_called(str(ROOT / "config" / "drives" / "three_mass.mo"), None, output)
    return replace(drawn.space, name=name, notes=(note,), report=report)


def merged(drive: StateSpace, name: str = "Jm") -> StateSpace:
    """The same drive with Jm = J1 + n^2 J2, as two rigidly joined inertias give it, under this name."""
    symbol = Laurent.symbol
    rotor = FlatParameter("J1", "kg m^2", "rotor", 0.005, True)
    brake = FlatParameter("J2", "kg m^2", "brake", 0.001, True)
    ratio = FlatParameter("n", "1", "ratio of the brake", 0.5)
    kept = tuple(p for p in drive.drawn if p.name != "Jm")
    definition = SymbolicDefinition(name, symbol("J1") + symbol("n", 2) * symbol("J2"))
    return replace(renamed(drive, {"Jm": name}), drawn=(rotor, brake, ratio, *kept), definitions=(definition,))


def renamed(drive: StateSpace, names: Mapping[str, str]) -> StateSpace:
    """The same drive with other names of its parameters."""
    symbols = {old: Laurent.symbol(new) for old, new in names.items()}

    def substituted(entries: Entries) -> Entries:
        return {place: value.substitute(symbols) for place, value in entries.items()}

    parameters = tuple(replace(p, name=names.get(p.name, p.name)) for p in drive.parameters)
    return replace(
        drive,
        parameters=parameters,
        drawn=parameters,
        A=substituted(drive.A),
        B=substituted(drive.B),
        C=substituted(drive.C),
    )


ONSETS, WITHIN_S = 30, 4.0
OWN = (
    HypothesisThreshold("kT", 0.1, 11.0, 0.001),
    HypothesisThreshold("kT", -0.1, 12.0, 0.002),
    HypothesisThreshold("torque sign", math.nan, 13.0, 0.0, ("output sign",)),
)


@cache
def by_hand() -> Calibration:
    """A calibration of the demo's first axis, without trials of faults in fm."""
    axis = load(ROOT / "config" / "demo.toml", {}).axes[0]
    model = axis_model(axis.config)
    thresholds = tuple(Threshold(2.0 + i, 3.0 + i, 0.0) for i in range(3))
    settings = replace(axis_settings(axis, model), thresholds=thresholds)
    h, ones = settings.interval_s, np.ones(3)
    scatter = Scatter(
        0.0 * ones,
        0.01 * ones,
        np.array([0.011, 0.012, 0.013]),
        np.ones((2, 3)),
        np.zeros((2, 3)),
        9.0,
        200.0,
    )
    rates = Rates(h / np.array([3e4, 4e4, 5e4]), h / 7200, h / 36000, h / 3600, 5.0)
    bank = BankThresholds(OWN, h / 10800, h / 72000, h / 5400)
    result = CalibrationResult(
        model, settings, 3600.0, WITHIN_S, scatter, rates, np.zeros(3), _by_tests(), ONSETS, 600.0,
        MultiModelCalibration(bank, _by_bank(), 0.375),
    )  # fmt: skip
    name, dropped = "healthy.csv", {"missing": 12}
    record = RecordOrigin(name, Path(name), "ab12", 120000, 120000, 0.0, 600.0, dropped)
    return Calibration(
        axis, result, (record,), ("Mind the gap.",),
        Provenance("1.2.3", "2002-02-02T02:02:02+00:00", "axiswatch calibrate healthy.csv"), "multimodel",
    )  # fmt: skip


def _by_tests() -> list[TrialResult]:
    """Of kT 20 % are found in time, by a hair, and 10 % are not; of 1/Ja 50 % upwards, nothing downwards."""
    missed = [("kT", 27), ("", 3)]
    return [
        caught("kT", 0.1, np.linspace(1.0, 30.0, ONSETS), [("kT", 20), ("1/Ja", 10)]),
        caught("kT", 0.2, [3.0] * 27 + [math.inf] * 3, missed),
        caught("kT", 0.5, [2.0] * ONSETS, [("kT", ONSETS)]),
        caught("kT", -0.1, [3.5] * 26 + [9.0] * 4, [("kT", ONSETS)]),
        caught("kT", -0.2, [2.5] * ONSETS, [("kT", ONSETS)]),
        caught("1/Ja", 0.2, [5.0] * ONSETS, [("1/Ja", ONSETS)]),
        caught("1/Ja", 0.5, [1.5] * ONSETS, [("1/Ja", ONSETS)]),
        caught("1/Ja", -0.5, [math.inf] * ONSETS, [("", ONSETS)]),
    ]


def _by_bank() -> list[TrialResult]:
    """The same faults: of kT 10 % are found in time, too; of 1/Ja all."""
    return [
        caught("kT", 0.1, [0.5] * 15 + [0.75] * 15, [("kT", 28), ("delay", 1), ("noise", 1)]),
        caught("kT", 0.2, [0.25] * ONSETS, [("kT", ONSETS)]),
        caught("kT", 0.5, [0.125] * ONSETS, [("kT", ONSETS)]),
        caught("kT", -0.1, [0.6] * ONSETS, [("kT", ONSETS)]),
        caught("kT", -0.2, [0.3] * ONSETS, [("kT", ONSETS)]),
        caught("1/Ja", 0.2, [0.4] * ONSETS, [("1/Ja", ONSETS)]),
        caught("1/Ja", 0.5, [0.2] * ONSETS, [("1/Ja", ONSETS)]),
        caught("1/Ja", -0.5, [0.7] * ONSETS, [("1/Ja", 15), ("fm", 15)]),
    ]


def caught(name: str, size: float, delays: Sequence[float] | np.ndarray, names: list[tuple[str, int]]) -> TrialResult:
    """With so many alarms of each name."""
    first = tuple(name for name, many in names for _ in range(many))
    assert len(delays) == len(first) == ONSETS
    exact = name == "kT"
    way = "up" if size > 0 else "down"
    return TrialResult(
        InjectedFault(name, size), exact, np.array(delays), first, (way,) * ONSETS, 3.0 if exact else math.nan
    )
