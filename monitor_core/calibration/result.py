"""Result of a calibration: thresholds, their false-alarm rate, and the changes that each detector finds."""

from collections.abc import Sequence
from dataclasses import dataclass

from monitor_core.arrays import Floats
from monitor_core.calibration.budget import Rates
from monitor_core.calibration.fault_trials import TrialResult
from monitor_core.calibration.multimodel_thresholds import BankThresholds
from monitor_core.calibration.scatter import Scatter
from monitor_core.detection import DetectorName
from monitor_core.drive.axis_model import AxisModel
from monitor_core.settings import Settings
from monitor_core.wording import duration

FOUND_SHARE = 0.9
"""A change counts as found if the detector finds it from this share of the onsets."""
_LONGEST_S, _LONGER = 3.15576e9, "more than 100 years"
"""Longer times between false alarms come from the tail of a fitted distribution, which no record supports."""


@dataclass(frozen=True)
class DetectorResult:
    """Performance of one detector; ``within_s`` as in ``CalibrationResult``.

    ``between_s``: mean time between false alarms [s]: most likely value and bounds of the 90 % interval.  ``caught``:
    trials of all changes, with the names of the alarms: the first name of the CUSUM tests, the final name of the
    multi-model detector.
    """

    detector: DetectorName
    between_s: tuple[float, float, float]
    caught: Sequence[TrialResult]
    within_s: float

    @property
    def promise(self) -> str:
        """The false-alarm rate as a sentence."""
        most, low, high = (duration(v) if v <= _LONGEST_S else _LONGER for v in self.between_s)
        return f"one false alarm in {most}, with 90 % certainty between one in {low} and one in {high}"

    def smallest(self, name: str) -> tuple[float | None, float | None]:
        """Smallest increase and decrease, in sizes of the parameter, that were found in time; None: none was found."""
        own = (trial for trial in self.caught if trial.fault.parameter == name)
        found = [t.fault.size for t in own if t.found_within(self.within_s) >= FOUND_SHARE]
        return min((v for v in found if v > 0), default=None), max((v for v in found if v < 0), default=None)

    def confusion(self) -> dict[str, dict[str, int]]:
        """Confusion matrix: number of changes of each parameter by the name of the alarm; "" is no alarm."""
        tried = dict.fromkeys(trial.fault.parameter for trial in self.caught)
        others = sorted({name for trial in self.caught for name in trial.first} - {*tried, ""})
        table = {name: dict.fromkeys((*tried, *others, ""), 0) for name in tried}
        for trial in self.caught:
            for name in trial.first:
                table[trial.fault.parameter][name] += 1
        return table


@dataclass(frozen=True)
class MultiModelCalibration:
    """Thresholds of the multi-model detector, and its detection of the same changes.

    ``evidence_share``: share of the evidence that counts for the probabilities of causes (evidence_share.py).
    """

    thresholds: BankThresholds
    caught: Sequence[TrialResult]
    evidence_share: float = 1.0


@dataclass(frozen=True)
class CalibrationResult:
    """Result of ``calibrate``; times in seconds.

    Attributes:
        model: the axis, as given.
        settings: as given, with the thresholds.
        budget_s: mean time between false alarms that the thresholds keep [s].
        within_s: time within which changes of the smallest possible size must be found [s].
        scatter: scatter of healthy estimates in the records.
        rates: rate of false alarms of the CUSUM tests, with its uncertainty.
        allowance: allowance of each test (p,), in sizes of its parameter.
        caught: trials of the CUSUM tests; empty if the records are too short for trials.
        onsets: number of onsets of each change.
        records_s: total length of the records [s].
        bank: the multi-model detector; None: it is not available for the axis.
    """

    model: AxisModel
    settings: Settings
    budget_s: float
    within_s: float
    scatter: Scatter
    rates: Rates
    allowance: Floats
    caught: Sequence[TrialResult]
    onsets: int
    records_s: float
    bank: MultiModelCalibration | None = None

    @property
    def tests(self) -> DetectorResult:
        """Performance of the CUSUM tests."""
        return DetectorResult("cusum", self._between(self.rates), self.caught, self.within_s)

    @property
    def by_bank(self) -> DetectorResult | None:
        """Performance of the multi-model detector, if it is available for the axis."""
        if self.bank is None:
            return None
        return DetectorResult("multimodel", self._between(self.bank.thresholds), self.bank.caught, self.within_s)

    def _between(self, rates: Rates | BankThresholds) -> tuple[float, float, float]:
        h = self.settings.interval_s
        return h / rates.total, h / rates.upper, h / rates.lower
