"""``--masses``: rows of masses beside the drive, and what the reports say of them."""

import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from monitor_core.identification.problem import IdentificationError
from monitor_core.identification.starting import Growth, masses_of
from service.commands.commissioning.axis.identification_task import Request, prepare
from service.config import Config, load
from service.reports.identification_report import IdentificationReport
from tests.service.command_line import refused, shown
from tests.service.commands.identify.conftest import FREE, PROVENANCE
from tests.service.config.config_texts import TABLES

pytestmark = pytest.mark.usefixtures("without_pictures")

GRAVITY = (
    TABLES.partition("model =")[0]
    + """\
[robot.axis.model]
drive = "one-mass-weight"
monitor = ["fm"]
nominal = { J = 0.006, fm = 0.06, fc = 0.0, tau0 = 0.0, gc = 1.0, gs = 0.0, kT = 1.0, r = 1.0 }
"""
)


def test_two_masses_are_not_enough_for_a_drive_of_three(folder: Path, tmp_path: Path) -> None:
    """The comparison is in all reports; the drive of three is not doubted where the search ended at two."""
    words = ("--start", "values", "--free", ",".join(FREE), "--masses", "2", "--json", tmp_path / "all.json")
    files = ("--config", folder / "robot.toml", "-o", tmp_path / "nominal.toml")
    text = shown("identify", folder / "second.csv", *files, *words)
    content = json.loads((tmp_path / "all.json").read_text(encoding="utf-8"))
    masses = content["masses"]
    # Six seconds may not ask for the second mass, without which the third is never tried; that is then doubted.
    assert masses["recommended"] in (1, 2)
    doubts = [word for word in content["warnings"] if "in a row" in word]
    assert len(doubts) == (masses["recommended"] == 1)
    one_mass, two_masses = masses["models"]
    assert (one_mass["masses"], two_masses["masses"]) == (1, 2)
    assert two_masses["cost"] < one_mass["cost"]
    assert set(one_mass["values"]) == {"J1", "fm", "fc", "tau0"}
    printed = " ".join(text.split())
    assert "Masses in a row; AIC and BIC above the least" in printed
    assert masses["words"][0] in printed
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "How many masses" in page
    assert masses["words"][0] in page


def growth_of(recommended: int, tried: int) -> Growth:
    models: list[Any] = [None] * tried
    return Growth(tuple(models), recommended, ("Because.",))


@pytest.mark.parametrize(
    ("recommended", "tried", "words"),
    [
        (1, 2, "ask for one mass"),
        (2, 3, "2 masses"),
        (2, 2, ""),
        (3, 3, ""),
        (3, 4, ""),
        (5, 5, "5 masses"),
        (4, 5, "4 ma"),
    ],
)
def test_another_number_of_masses_than_the_drive_has_is_reported(
    found: IdentificationReport, recommended: int, tried: int, words: str
) -> None:
    assert masses_of(found.result.estimate.problem) == 3
    doubts = replace(found, result=replace(found.result, growth=growth_of(recommended, tried))).warnings
    stated = [word for word in doubts if "in a row, and the drive three-mass has 3" in word]
    assert len(stated) == bool(words)
    assert all(words in word for word in stated)
    assert set(found.warnings) == set(doubts) - set(stated)


def test_a_drive_that_is_not_free_has_no_number_of_masses(found: IdentificationReport) -> None:
    problem = replace(found.result.estimate.problem, free=("Jm", "fm"))
    assert masses_of(problem) is None


def test_masses_are_compared_only_on_request(folder: Path, robot: Config) -> None:
    task = prepare(robot, robot.axes[0], [str(folder / "second.csv")], [], Request())
    assert task.options.max_masses is None


def test_gravity_is_refused_before_anything_is_fitted(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text(GRAVITY, encoding="utf-8")
    shutil.copy(folder / "second.csv", tmp_path)
    config = load(tmp_path / "a.toml", {})
    record = [str(tmp_path / "second.csv")]
    task = prepare(config, config.axes[0], record, [], Request(masses=2, free=("J", "fm", "gc")))
    with pytest.raises(IdentificationError, match="without gravity, which acts on this drive"):
        task.run(PROVENANCE)


@pytest.mark.parametrize("wrong", ["0", "10", "-1", "all", "2.5"])
def test_a_wrong_number_is_named(folder: Path, wrong: str) -> None:
    message = refused("identify", folder / "second.csv", "--config", folder / "robot.toml", f"--masses={wrong}")
    assert f"{wrong}: write auto, or 1 to 9" in message
