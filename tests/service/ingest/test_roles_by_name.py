"""What columns and signals are by their names, and of which axis."""

import pytest

from service.ingest.roles_by_name import axis_number, role_of


@pytest.mark.parametrize(
    ("name", "role"),
    [
        ("A1_Motorstrom", "current"),
        ("Achse 2 Istwinkel", "angle"),
        ("Istposition_3", "angle"),
        ("Motordrehzahl", "speed"),
        ("A1_Sollwinkel", "wanted"),
        ("Sollstrom", "wanted"),
        ("Achse 1 Lageistwert", "angle"),
        ("Momentenistwert", "torque"),
        ("Drehzahlsollwert_2", "wanted"),
        ("Drahtvorschub", ""),
        ("AIPos.A1", "angle"),
        ("TorqueReference", "wanted"),
        ("Consigne couple", "wanted"),
        ("Axis_X.PositionError", "other"),
        ("torque_ff_ref", "other"),
        ("PCTRL_S_ACT", ""),
        ("t_s", "time"),
    ],
)
def test_words_of_loggers(name: str, role: str) -> None:
    """Of German compound words, of words without a space between them; what is neither measured nor commanded."""
    assert role_of(name) == role


@pytest.mark.parametrize(
    ("name", "number"),
    [
        ("Axis 2 S-0-0084 Torque", "2"),
        ("SERVO_1.r63[0]", "1"),
        ("gAxis[3].Drive0", "3"),
        ("A4_Pos", "4"),
        ("field.effort0", "0"),
        ("17", ""),
    ],
)
def test_the_number_of_an_axis(name: str, number: str) -> None:
    """It stands behind a word for an axis, otherwise last; a column that is called by its place has none."""
    assert axis_number(name) == number
