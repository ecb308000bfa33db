"""Sensitivities against a complex step through a whole simulation, and what they say against many estimates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pytest
import scipy.linalg as sla
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from monitor_core.arrays import Floats
from monitor_core.drive.structure import Drive, Output
from monitor_core.excitation.accuracy import Accuracy
from monitor_core.excitation.prediction import Sensitivities
from monitor_core.modeling.identifiability import structural
from monitor_core.modeling.simulated_axis import SimulatedAxis
from monitor_core.modeling.standard_drives import INTERVAL_S, REFERENCE_VALUES, three_mass
from monitor_core.modeling.statespace import drive_of
from tests.core.modeling.spaces import some_chain, table

law = settings(deadline=None, max_examples=20)
seeds = st.integers(0, 2**32 - 1)
STEP = 1e-30
MOVING = {**REFERENCE_VALUES, "fc": 0.3, "tau0": 0.1}
ALL = ("Jm", "1/Jg", "Ja", "kg", "1/ka", "dg", "da", "fm", "fc", "tau0", "kT", "r")


def sensitivities(
    drive: Drive,
    values: Mapping[str, float],
    names: Sequence[str],
    torque: Floats,
    interval_s: float = INTERVAL_S,
    scales: Mapping[str, float] | None = None,
) -> Floats:
    """From rest, under a torque."""
    u = inputs_of(drive, values, torque, interval_s)
    return Sensitivities(drive, values, names, interval_s, scales).along(u)


def inputs_of(drive: Drive, values: Mapping[str, float], torque: Floats, interval_s: float) -> Floats:
    """All inputs (N, m) of the drive that the torque moves from rest."""
    axis = SimulatedAxis(values, substeps=1, drive=drive)
    inputs = []
    for value in torque.tolist():
        inputs.append(axis.inputs(value))
        axis.step(value, interval_s)
    return np.array(inputs)


def torque(seed: int, N: int = 120) -> Floats:
    return np.random.default_rng(seed).normal(size=N) * 1.5


# --- the oracle: everything complex ------------------------------------------------------------------------


def response(drive: Drive, values: Mapping[str, complex], u: NDArray[np.generic], h: float) -> NDArray[np.complex128]:
    """Output for inputs (N, m): the exponential of the system with its inputs as states, and no derivative anywhere."""
    A, B, C = drive.matrices(values)  # type: ignore[arg-type]
    n, m = B.shape
    M = np.zeros((n + m, n + m), dtype=complex)
    M[:n, :n], M[:n, n:] = A, B
    balanced, (d, _) = sla.matrix_balance(M, permute=False, separate=True)
    E = d[:, None] * sla.expm(balanced * h) / d
    x, out = np.zeros(n, dtype=complex), []
    for inputs in u:
        out.append(C[0] @ x)
        x = E[:n, :n] @ x + E[:n, n:] @ inputs
    return np.array(out)


def by_complex_step(drive: Drive, values: Mapping[str, float], name: str, size: float, u: Floats, h: float) -> Floats:
    base = name.removeprefix("1/")
    at = dict[str, complex](values)
    if base == name:
        at[name] = values[name] + 1j * STEP * size
    else:
        at[base] = 1 / (1 / values[base] + 1j * STEP * size)
    complete = drive.complete(at)  # type: ignore[arg-type]
    return np.asarray(np.imag(response(drive, complete, u, h)) / STEP)


def agree(S: Floats, expected: Sequence[Floats]) -> None:
    for column, other in zip(S.T, expected, strict=True):
        scale = np.abs(other).max()
        assert scale > 0
        assert np.abs(column - other).max() <= 1e-9 * scale


@pytest.mark.parametrize("output", ["speed", "angle"])
def test_sensitivities_are_the_derivatives_of_a_simulation(output: Output, seed: int) -> None:
    drive, u = three_mass(output), torque(seed)
    S = sensitivities(drive, MOVING, ALL, u)
    inputs = inputs_of(drive, MOVING, u, INTERVAL_S)
    sizes = [1 / MOVING[name[2:]] if name.startswith("1/") else MOVING[name] for name in ALL]
    agree(S, [by_complex_step(drive, MOVING, n, s, inputs, INTERVAL_S) for n, s in zip(ALL, sizes, strict=True)])


def test_a_drawn_parameter_moves_what_it_is_merged_into(seed: int) -> None:
    ss = table({(0, 0): "-f/M"}, {(0, 0): "kT/M"}, {(0, 0): "1"}, definitions={"M": "J1 + J2*r^2"})
    drive, u = drive_of(ss), torque(seed)
    values = {"J1": 0.2, "J2": 3.0, "r": 0.3, "f": 0.7, "kT": 1.1}
    S = sensitivities(drive, values, ("J1", "1/J2", "r", "M", "f", "kT"), u)
    names = ("J1", "1/J2", "r", "f", "kT")
    sizes = (0.2, 1 / 3.0, 0.3, 0.7, 1.1)
    agree(
        S[:, [0, 1, 2, 4, 5]],
        [by_complex_step(drive, values, n, s, u[:, None], INTERVAL_S) for n, s in zip(names, sizes, strict=True)],
    )
    # dM/M = (J1 / M) dJ1/J1
    M = 0.2 + 3.0 * 0.3**2
    np.testing.assert_allclose(S[:, 0], S[:, 3] * 0.2 / M, rtol=1e-9, atol=1e-12)
    # a merged value that is given, too, does not hide the change
    np.testing.assert_allclose(sensitivities(drive, {**values, "M": M}, ("J1",), u), S[:, :1], rtol=1e-9, atol=1e-12)


def test_a_sensor_that_a_parameter_scales(seed: int) -> None:
    drive = drive_of(table({(0, 0): "-f"}, {(0, 0): "1"}, {(0, 0): "r"}))
    values, u = {"f": 0.5, "r": 0.2}, torque(seed)
    S = sensitivities(drive, values, ("f", "r"), u)
    agree(S, [by_complex_step(drive, values, n, values[n], u[:, None], INTERVAL_S) for n in ("f", "r")])
    np.testing.assert_allclose(S[:, 1], np.real(response(drive, values, u[:, None], INTERVAL_S)), atol=1e-13)


def test_a_scale_is_the_size(seed: int) -> None:
    drive, u = three_mass("speed"), torque(seed)
    S = sensitivities(drive, MOVING, ("tau0", "fm"), u)
    scaled = sensitivities(drive, MOVING, ("tau0", "fm"), u, scales={"tau0": 0.3, "fm": 0.006})
    np.testing.assert_allclose(scaled, S * [3.0, 0.1], rtol=1e-9, atol=1e-14)


@pytest.mark.parametrize(
    ("names", "values", "error", "text"),
    [
        (("tau0",), REFERENCE_VALUES, ValueError, "tau0 has the nominal value 0: give its scale"),
        (("1/fc",), REFERENCE_VALUES, ValueError, "1/fc has the nominal value 0"),
        (("Jx",), REFERENCE_VALUES, KeyError, "has no parameter 'Jx'; it has Jm"),
        (("Jm",), {"Jm": 1.0}, KeyError, "no nominal value for Jg"),
        (("Jm",), {**REFERENCE_VALUES, "Jm": -1.0}, ValueError, "nominal Jm = -1.0"),
    ],
)
def test_wrong_names_and_values(
    names: tuple[str, ...], values: Mapping[str, float], error: type[Exception], text: str
) -> None:
    with pytest.raises(error, match=text):
        sensitivities(three_mass("speed"), values, names, np.ones(3))


# --- hidden directions: as many as by structure ------------------------------------------------------------


@law
@given(seed=seeds, masses=st.integers(1, 3), data=st.data())
def test_a_rich_record_hides_what_the_structure_hides(seed: int, masses: int, data: st.DataObject) -> None:
    ss = some_chain(masses, data, 1)
    rng = np.random.default_rng(seed)
    values = {p.name: rng.uniform(0.5, 2.0) for p in ss.drawn}
    names = tuple(values)
    found = structural(ss, seed=seed)
    accuracy = Accuracy(names, sensitivities(drive_of(ss), values, names, rng.normal(size=200), 0.3))
    sizes = np.linalg.svd(accuracy.S / np.maximum(accuracy.lengths, 1e-300), compute_uv=False)
    assume(not np.any((sizes > 1e-13) & (sizes < 1e-7)))  # else a drive hides what its structure would show
    assert len(accuracy.hidden) == len(names) - found.count
    infinite = {n for n, sd in zip(names, accuracy.standard_deviations, strict=True) if sd == np.inf}
    assert infinite == set(names) - set(found.identifiable)
    if infinite:
        assert any("does not move the output at all" in text for text in accuracy.words())


# --- what the sensitivities say --------------------------------------------------------------------------------


def columns(seed: int, *rows: Sequence[float], N: int = 400) -> Floats:
    """Sensitivities with these components over orthonormal signals."""
    q = np.linalg.qr(np.random.default_rng(seed).normal(size=(N, len(rows[0]))))[0]
    return np.asarray(q @ np.array(rows).T)


def test_a_pair(seed: int) -> None:
    """Columns at an angle: the estimates correlate by minus its cosine."""
    cosine = 0.99
    accuracy = Accuracy(
        ("kg", "ka", "c"), columns(seed, [1, 0, 0], [cosine, np.sqrt(1 - cosine**2), 0], [0, 0, 1]), 0.05
    )
    ((first, second, r),) = accuracy.pairs()
    assert (first, second) == ("kg", "ka")
    assert r == pytest.approx(-0.99)
    sd = 0.05 / np.sqrt(1 - cosine**2)
    np.testing.assert_allclose(accuracy.standard_deviations, [sd, sd, 0.05])
    ((size, parts),) = accuracy.directions()
    assert size == pytest.approx(np.sqrt(1 - cosine))
    assert [name for name, _ in parts] == ["kg", "ka"]
    assert [value for _, value in parts] == pytest.approx([np.sqrt(0.5), -np.sqrt(0.5)])
    # with little noise both are told, however much the one depends on the other
    assert Accuracy(accuracy.names, accuracy.S, 0.001).words() == ()


CANNOT = "cannot all be determined from this record"
HIDDEN = "does not move the output at all."
WORDS: dict[str, tuple[list[list[float]], float, set[str]]] = {
    "a pair": (
        [[1, 0], [0.99, np.sqrt(1 - 0.99**2)]], 0.05,
        {"a and b cannot both be determined from this record: their estimates correlate by -0.99"
         " (standard deviations 35 % and 35 %)."},
    ),
    "one that is weak": (
        [[5, 0], [0, 0.1]], 0.12, {"b cannot be determined from this record (standard deviation 120 %)."},
    ),
    "two that are weak": (
        [[5, 0, 0], [0, 0.1, 0], [0, 0, 0.05]], 0.12,
        {"b (120 %) and c (240 %) cannot be determined from this record (standard deviations in brackets)."},
    ),
    # c is nearly a + b: no two correlate so much, all three do.
    "the only pair in a group, with its number": (
        [[1, 0, 0], [0.95, 0.3, 0], [0.3, -0.2, 0.15]], 0.1,
        {f"a, b and c {CANNOT}: the joint change +a -b -c moves the output by only 11 % of what separate changes do,"
         " and the estimates of a and b correlate by -0.98."},
    ),
    # Two pairs, in each of which one column is a multiple of the other, and a column of zeros.
    "hidden directions, named apart": (
        [[1, 0, 0], [-2, 0, 0], [0, 1, 0], [0, 0.5, 0], [0, 0, 1], [0, 0, 0]], 0.01,
        {f"a and b cannot both be determined from this record: the joint change +a +b {HIDDEN}",
         f"c and d cannot both be determined from this record: the joint change +c -d {HIDDEN}",
         "f has no effect in this record."},
    ),
}  # fmt: skip


@pytest.mark.parametrize("what", WORDS)
def test_words(what: str, seed: int) -> None:
    rows, noise, expected = WORDS[what]
    accuracy = Accuracy(tuple("abcdef"[: len(rows)]), columns(seed, *rows), noise)
    assert set(accuracy.words()) == expected
    if what.startswith("hidden"):
        np.testing.assert_array_equal(accuracy.standard_deviations[[0, 1, 2, 3, 5]], np.inf)
        assert accuracy.standard_deviations[4] == pytest.approx(0.01)
        assert accuracy.pairs() == ()


def test_a_group_of_three_and_pairs_that_it_explains_are_not_said_twice(seed: int) -> None:
    """Estimates of the three correlate by +-1, which the group says."""
    S = columns(seed, [1, 0, 0, 0, 0], [0, 1, 0, 0, 0], [0.7, 0.7, 0.01, 0, 0], [0, 0, 0, 1, 0], [0, 0, 0, 1, 0.01])
    accuracy = Accuracy(("a", "b", "c", "d", "e"), S, 0.002)
    pairs = {(first, second) for first, second, _ in accuracy.pairs()}
    assert pairs == {("a", "b"), ("a", "c"), ("b", "c"), ("d", "e")}
    pair, group = accuracy.words()
    assert pair.startswith("d and e cannot both be determined")
    assert group == (
        f"a, b and c {CANNOT}: the joint change +a +b -c moves the output by only 0.71 % of what separate changes do."
    )


def test_a_group_that_says_nothing_new_is_left_out(seed: int) -> None:
    """Five columns nearly the same: the weakest direction is of all five, which is enough said."""
    apart = [[-1, 1, 3, 1], [2, -2, 0, 0], [2, 0, 2, -1], [1, 1, -2, 0], [-1, -4, 2, -1]]
    accuracy = Accuracy(tuple("abcde"), columns(seed, *([1, *(0.001 * v for v in row)] for row in apart)), 0.01)
    assert [len(d.names) for d in accuracy.directions()] == [5, 3, 3, 2]
    (group,) = [text for text in accuracy.words() if "joint change" in text]
    assert group.startswith(f"a, b, c, d and e {CANNOT}")


@pytest.mark.parametrize(
    ("S", "noise", "text"),
    [(np.zeros((5, 3)), 1.0, "for 2 parameters"), (np.zeros((5, 2)), 0.0, "noise 0.0")],
)
def test_wrong_arguments(S: Floats, noise: float, text: str) -> None:
    with pytest.raises(ValueError, match=text):
        Accuracy(("a", "b"), S, noise)
