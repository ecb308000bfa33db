"""Mistakes in the columns of a table, each named by what puts it right."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from monitor_core.arrays import Floats
from service.can.user_errors import IngestError
from service.commands.commissioning.axis import axis_identification
from service.commands.commissioning.axis.axis_commissioning import commission_axis
from service.commands.commissioning.axis.axis_job import AxisJob
from service.commands.commissioning.signals.exchanged_torques import exchanged
from service.commands.commissioning.signals.signal_proposals import review
from service.config import Config, NamedAxis
from service.reports.formats import Provenance
from tests.service.commands.commissioning.two_mass_tables import (
    AXIS,
    FEW,
    VALUES,
    H,
    read_rows,
    table,
    write_rows,
)
from tests.service.commands.moving_axes import moves

ROBOT = "[[robot]]\nname = 'cell'\n"
NOMINAL = ", ".join(f"{name} = {value}" for name, value in VALUES.items())


def known(n: int = 1) -> str:
    """An axis whose nominal values are about known."""
    text = AXIS.format(n=n, interval=H).replace("nominal = { kT = 1, r = 0.0085 }", f"nominal = {{ {NOMINAL} }}")
    return text.replace("Jm = 0.006", "Jm = 0.005").replace("Ja = 100.0", "Ja = 85.0")


def changed(path: Path, change: Callable[[Floats], None]) -> str:
    """The table with other columns: time, torque, angle, torque, ..."""
    rows = read_rows(path)
    rows[:, 0] -= rows[0, 0]
    change(rows)
    return str(write_rows(path, rows))


def milliseconds(rows: Floats) -> None:
    rows[:, 0] *= 1e3


def half_the_rate(rows: Floats) -> None:
    rows[:, 0] *= 2


def turned(rows: Floats) -> None:
    rows[:, 1] *= -1


def turned_in_milliseconds(rows: Floats) -> None:
    turned(rows)
    milliseconds(rows)


MISTAKES: list[tuple[Callable[[Floats], None], list[tuple[tuple[str, ...], float]]]] = [
    (milliseconds, [(("time", "factor"), 1e-3)]),
    (half_the_rate, [(("sample_interval_s",), 0.01)]),
    (turned_in_milliseconds, [(("time", "factor"), 1e-3), (("torque", "factor"), -1.0)]),
]


@pytest.mark.parametrize(("change", "right"), MISTAKES, ids=[change.__name__ for change, _ in MISTAKES])
def test_each_mistake_is_put_right(
    change: Callable[[Floats], None], right: list[tuple[tuple[str, ...], float]], tmp_path: Path, seed: int
) -> None:
    record = changed(table(tmp_path / "record.csv", seed, 20.0), change)
    found = review(ROBOT + known(), "cell.a1", [record], tmp_path).corrections
    assert [correction.key for correction in found] == [key for key, _ in right]
    assert [correction.value for correction in found] == pytest.approx([value for _, value in right], rel=1e-3)


@pytest.mark.parametrize(("late", "corrected"), [(2, 2), (13, 10)])
def test_a_torque_that_comes_late_is_taken_with_its_motion(
    late: int, corrected: int, tmp_path: Path, seed: int
) -> None:
    axis = moves("one-mass", seed, 60.0)
    rows = np.column_stack([axis.t[late:], axis.torque[:-late], axis.angle[late:]])
    np.savetxt(tmp_path / "late.csv", rows, "%.9g", ",", header="t,u,y", comments="")
    keys = f"sample_interval_s = {H}\ntime = {{ column = 't' }}\nangle = {{ column = 'y' }}\n"
    model = "model = { drive = 'one-mass', monitor = ['kT', 'fc', 'fm'], nominal = { kT = 1 } }\n"
    text = f"{ROBOT}[[robot.axis]]\nname = 'a1'\n{keys}torque = {{ column = 'u' }}\n{model}"
    found = review(text, "cell.a1", [str(tmp_path / "late.csv")], tmp_path)
    (correction,) = found.corrections
    assert correction.change == f"torque.late_samples = {corrected}"
    assert [words.startswith(f"the torque comes {late} samples or more later") for words in found.faults] == (
        [] if late == corrected else [True]
    )


def test_the_samples_that_are_in_memory_at_once(tmp_path: Path, seed: int) -> None:
    """Those that are used, and of the other ones those of one file: files are read one after the other."""
    records = [changed(table(tmp_path / f"{k}.csv", seed + k, 12.0), lambda _: None) for k in range(2)]
    both, parts, alone = (
        review(ROBOT + known(), "cell.a1", names, tmp_path).samples
        for names in (records, [f"{record}@2:8" for record in records], records[:1])
    )
    assert alone == round(12.0 / H)
    assert both == 2 * alone
    assert parts == pytest.approx(1.5 * alone, abs=5)


def test_a_record_in_which_the_axis_stands_is_left_out(
    tmp_path: Path, seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As where the controller runs the planned motion of another axis."""

    def stand(rows: Floats) -> None:
        rows[:, 1:] = 0.1, 0.5

    moving = changed(table(tmp_path / "moving.csv", seed, 12.0), lambda _: None)
    standing = changed(table(tmp_path / "standing.csv", seed, 12.0), stand)
    text = ROBOT + known()
    found = review(text, "cell.a1", [moving, standing], tmp_path)
    assert (found.corrections, found.faults, found.standing) == ((), (), (standing,))
    alone = review(text, "cell.a1", [standing], tmp_path)
    assert "is 0.1 throughout" in alone.faults[0]

    used = list[object]()

    def prepare(_config: Config, _axis: NamedAxis, records: object, *_: object) -> None:
        used.append(records)
        raise IngestError("seen")

    monkeypatch.setattr(axis_identification, "prepare", prepare)
    job = AxisJob(text, "cell.a1", (moving, standing), tmp_path, FEW, Provenance("", "", ""), shorten=False)
    outcome = commission_axis(job, found)
    assert (used, outcome.refusal) == ([(moving,)], "not identified: seen")
    assert f"{standing} is left out: the axis does not move in it." in outcome.notes


@pytest.mark.parametrize("swap", [False, True])
@pytest.mark.parametrize("sign", [1, -1])
def test_axes_with_the_torque_of_each_other(swap: bool, sign: int, tmp_path: Path, seed: int) -> None:
    """Whether one of the torques has the wrong sign as well or not."""

    def change(rows: Floats) -> None:
        rows[:, 1] *= sign
        if swap:
            rows[:, [1, 3]] = rows[:, [3, 1]]

    record = changed(table(tmp_path / "record.csv", seed, 20.0, axes=2), change)
    found = exchanged(ROBOT + known(1) + known(2), {f"cell.a{n}": [record] for n in (1, 2)}, tmp_path)
    right = {"cell.a1": "A2_Trq", "cell.a2": "A1_Trq"} if swap else {}
    assert {axis: corrections[0].value for axis, corrections in found.items()} == right


@pytest.mark.parametrize(("times", "proposed"), [(0.5, True), (0.9, False), (1.0, False), (1.15, False), (2.0, True)])
def test_a_wrong_gear_ratio_is_told_from_nominal_inertias_that_are_about_right(
    times: float, proposed: bool, tmp_path: Path, seed: int
) -> None:
    record = table(tmp_path / "healthy.csv", seed, 20.0)
    right = VALUES["r"]
    text = ROBOT + known().replace(f"r = {right}", f"r = {times * right}")
    found = review(text, "cell.a1", [str(record)], tmp_path).corrections
    assert [c.key for c in found] == [("model", "nominal", "r")] * proposed
    for correction in found:
        assert correction.value == pytest.approx(right, rel=0.2)
