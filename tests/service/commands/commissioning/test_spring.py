"""One mass whose values do not fit the records from which they were found: a spring, or another drive."""

from pathlib import Path

import pytest

from service.commands.commissioning.axis import axis_commissioning
from service.commands.commissioning.axis.axis_commissioning import commission_axis
from service.commands.commissioning.axis.axis_job import AxisJob
from service.commands.commissioning.axis.identification_retries import Retry, with_spring
from service.commands.commissioning.signals.signal_proposals import Review
from service.config.written.commissioned import configured
from service.reports.formats import Provenance
from tests.conftest import no_pictures
from tests.service.commands.commissioning.two_mass_tables import FEW, table

ONE = """
[[robot]]
name = "cell"
[[robot.axis]]
name = "a1"
sample_interval_s = 0.005
time = { column = "Time" }
torque = { column = "A1_Trq" }
angle = { column = "A1_Pos" }
model = { drive = "one-mass", monitor = ["kT", "fc", "fm"], nominal = { kT = 1 } }
"""
BESIDE = ONE + ONE[ONE.index("[[robot.axis]]") :].replace('"a1"', '"a2"')
NAME = "cell.a1"


def one_axis(folder: Path, record: Path, shorten: bool = True) -> AxisJob:
    """The commissioning of an axis as ``init`` proposes it."""
    return AxisJob(ONE, NAME, (str(record),), folder, FEW, Provenance("0", "2026-01-01", "test"), shorten)


def test_one_mass_that_does_not_fit_its_records_gets_a_spring(tmp_path: Path, seed: int) -> None:
    """Of this axis it explains nine tenths of the motion, a good fit; but kT would be off by its own size."""
    record = table(tmp_path / "record.csv", seed, 22.0)
    with no_pictures():
        outcome = commission_axis(one_axis(tmp_path, record), Review((), (), (), ""))
    assert outcome.state == "ready", outcome
    (drive,) = (change for change in outcome.corrections if change.key == ("model", "drive"))
    assert drive.value == "two-mass"
    assert "as one-mass it was not calibrated: " in drive.reason
    assert "differs from its nominal value throughout" in drive.reason
    assert drive.reason.endswith("although they were found from them: the drive lacks something")
    assert set(outcome.finds) == {"kT", "1/Ja", "fm"}
    assert outcome.misfit is False


def test_where_a_spring_does_not_help_another_drive_is_asked_for(
    tmp_path: Path, seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(axis_commissioning, "identified_with_spring", lambda *_: None)
    record = table(tmp_path / "record.csv", seed, 22.0)
    with no_pictures():
        outcome = commission_axis(one_axis(tmp_path, record), Review((), (), (), ""))
    assert outcome.refusal.startswith("not calibrated: kT differs from its nominal value throughout")
    assert outcome.refusal.endswith("found from them: the drive lacks something; configure another one")
    assert outcome.nominal_file is not None


def test_without_consent_the_drive_stays(tmp_path: Path, seed: int) -> None:
    record = table(tmp_path / "record.csv", seed, 22.0)
    with no_pictures():
        outcome = commission_axis(one_axis(tmp_path, record, shorten=False), Review((), (), (), ""))
    assert outcome.refusal.startswith("not calibrated: ")
    assert ("model", "drive") not in {change.key for change in outcome.corrections}


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("sample_interval_s = 0.005", "sample_interval_s = 0.02"),
        ('"one-mass", monitor = ["kT", "fc", "fm"]', '"three-mass", monitor = ["kT", "fc", "fm"]'),
        ("angle = {", "coupling = { a2 = 0.5 }\nangle = {"),
    ],
)
def test_a_spring_is_tried_for_one_mass_of_its_own_at_fast_samples(old: str, new: str, tmp_path: Path) -> None:
    def tried(text: str) -> Retry | None:
        return with_spring(text, configured(text, NAME, tmp_path)[1], "not calibrated")

    again = tried(BESIDE)
    assert again is not None
    model = configured(again.text, NAME, tmp_path)[1].config.model
    assert (model.drive, model.monitor, dict(model.nominal)) == ("two-mass", ("kT", "1/Ja", "fm"), {"kT": 1, "r": 1})
    assert tried(BESIDE.replace(old, new, 1)) is None
