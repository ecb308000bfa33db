"""The recursion beside the joint extended Kalman filter of dynamax, on the same records: cost, scatter and delay.

A parameter of each record changes in its middle, in one half of them up, in the other down: a filter of logarithms
finds what grows sooner, one of the values what shrinks, by 10 % each at 20 %, as either walks by equal steps.  Scatter
is the rms deviation before that, relative; delay the samples until the mean estimate of the records has moved by 63 %
of the change.  One buys the other: with the memory, scatter falls like one over its root.  So what counts is scatter
times the root of the delay, here as the scatter at a delay of 200 samples.  The peer's random walk is the one whose
delays are nearest to those of lambda: Q = (1 - lambda) diag(P) of the recursion's own steady P.  That of our own is
the same.
"""

from __future__ import annotations

import math
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from monitor_core.arrays import Floats
from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.discretization import zero_order_hold
from monitor_core.drive.kalman import filter_gain
from monitor_core.excitation import multisine
from monitor_core.excitation.reference_experiment import BAND_HZ, TORQUE_RMS, faulty
from monitor_core.modeling.simulated_axis import simulate_linear
from monitor_core.modeling.standard_drives import REFERENCE_VALUES, three_mass
from monitor_core.monitoring import AxisBatch
from monitor_core.settings import Settings
from tests.bench import recursive_peers
from tests.bench.measure import Say, in_turns
from tests.end_to_end.processes import ROOT

pytestmark = pytest.mark.bench

PACKAGES = ("dynamax==1.0.3",)
H = 0.005
SAMPLES, FAULT_AT, FROM = 5000, 2500, 1250
RECORDS = 8
"""For each parameter, half of them of a change up; the scatter of all is taken together."""
PATIENCE_S = 900.0
NAMES = ("Jm", "Jg", "Ja", "kg", "ka", "dg", "da", "fm", "kT")
"""In the order of the peer."""
STIFF = {"Jm": 0.004, "Jg": 0.01, "Ja": 0.006, "kg": 50.0, "ka": 30.0, "dg": 0.08, "da": 0.04, "fm": 0.02}
MOTOR_SIDE = {"r": 1.0, "fc": 0.0, "tau0": 0.0, "kT": 1.0}
LAM = 0.995


def motor_side(values: Mapping[str, float]) -> dict[str, float]:
    """The same axis with the gear taken out."""
    arm = ("Jg", "Ja", "kg", "ka", "dg", "da")
    return {**{n: v * (values["r"] ** 2 if n in arm else 1) for n, v in values.items()}, "r": 1.0}


class Task(NamedTuple):
    """An axis, what is watched of it, its torque as the sum of a multisine and white torque, and its noises."""

    values: Mapping[str, float]
    watched: tuple[str, ...]
    band_hz: tuple[float, float]
    rms: float
    white: float
    torque_noise: float
    output_noise: float
    size: float  # of the faults, up and down, in the logarithm

    def change(self, record: int) -> tuple[str, float]:
        """What changes in a record, and by how much, in the logarithm."""
        turn, i = divmod(record, len(self.watched))
        return self.watched[i], -self.size if turn % 2 else self.size


TASKS = {
    "the paper's axis, three parameters": Task(
        motor_side(REFERENCE_VALUES), ("kT", "Ja", "fm"), BAND_HZ, TORQUE_RMS, 0.0, 0.3, 1.0, math.log(1.2)
    ),
    "a stiff axis, eight parameters": Task(
        {**STIFF, **MOTOR_SIDE}, tuple(STIFF), (0.5, 40.0), 1.0, 0.3, 0.01, 0.103, math.log(1.1)
    ),
}


class Records(NamedTuple):
    """Torque and speed (W, N); records go round the faults, and turn their signs."""

    u: Floats
    y: Floats


def records(task: Task, seed: int) -> Records:
    rng, drive, W = np.random.default_rng(seed), three_mass("speed"), RECORDS * len(task.watched)
    u = np.array([multisine(rng, SAMPLES, H, task.band_hz, task.rms) for _ in range(W)]).T
    u += task.white * rng.standard_normal(u.shape)
    acting = u + task.torque_noise * rng.standard_normal(u.shape)
    y, x = simulate_linear(drive, task.values, acting[:FAULT_AT], H)
    after = []
    for w in range(W):
        parameter, change = task.change(w)
        values = faulty(task.values, {parameter: math.exp(change)})
        after.append(simulate_linear(drive, values, acting[FAULT_AT:, [w]], H, x[:, [w]])[0])
    y = np.concatenate([y, np.concatenate(after, axis=1)])
    return Records(u.T.copy(), (y + task.output_noise * rng.standard_normal(y.shape)).T.copy())


class Ours:
    """The recursion on the records, axes side by side or one alone."""

    def __init__(
        self, task: Task, rec: Records, *, joint: bool, drift: bool = False, P: Floats | None = None
    ) -> None:
        """``P`` (p,): the variances of the logarithms that parameters have, which drift."""
        self.model = AxisModel(three_mass("speed"), task.values, task.watched)
        K, lam0 = filter_gain(self.model, H, task.torque_noise, task.output_noise)
        start = tuple((1e-4 if P is None else P) * self.model.scale**2 / lam0)
        own = Settings.paper(H, lam0=lam0, K=tuple(K), P0=start, settle_s=0.2, alpha2=1e9)
        self.settings = replace(own, joint_state=joint, random_walk=drift)
        self.rec = rec

    def run(self, axes: int) -> tuple[Floats, Floats]:
        """log(theta / theta0) (axes, N, p), and the mean steady variance of the logarithms (p,) before the faults."""
        u, y = (field[:axes].T for field in self.rec)
        t = np.repeat(np.arange(SAMPLES, dtype=np.int64)[:, np.newaxis] * round(H * 1e6), axes, axis=1)
        batch = AxisBatch([self.model] * axes, [self.settings] * axes)
        trace = batch.trace(t, np.ascontiguousarray(u), np.ascontiguousarray(y))
        theta = np.log(trace.theta / self.model.theta0[:, np.newaxis])
        P = self.settings.lam0 * trace.P[FROM:FAULT_AT].mean(axis=(0, 2)) / self.model.scale**2
        return np.moveaxis(theta, -1, 0), P

    def alone(self) -> Callable[[], object]:
        """A call that runs the first record."""
        batch = AxisBatch([self.model], [self.settings])
        start, t = batch.column(0), round(H * 1e6) * np.arange(SAMPLES, dtype=np.int64)[:, np.newaxis]
        u, y = (field[0][:, np.newaxis] for field in self.rec)

        def run() -> object:
            batch.restore(0, *start)
            return batch.run(t, u, y)

        return run


class Outcome(NamedTuple):
    """Of each watched parameter: relative rms deviation in per cent; samples to 63 % of the change."""

    scatter: Floats
    delay: Floats


def outcome(theta: Floats, task: Task) -> Outcome:
    p = len(task.watched)
    scatter = 100 * np.sqrt(np.mean(theta[:, FROM:FAULT_AT] ** 2, axis=(0, 1)))
    delays = []
    for i in range(p):
        share = [theta[w, FAULT_AT:, i] / task.change(w)[1] for w in range(i, len(theta), p)]
        over = np.mean(share, axis=0) > 1 - math.exp(-1)
        delays.append(float(over.argmax()) if over.any() else math.inf)
    return Outcome(scatter, np.array(delays))


def environment() -> Path | str:
    """The interpreter of the peer, which is no part of the program's own, installed from PyPI if need be.

    Or why there is none.
    """
    folder, wanted = ROOT / ".cache" / "recursive-peers", "\n".join(PACKAGES)
    python, ready = folder / "bin" / "python", folder / ".ready"
    if ready.exists() and ready.read_text(encoding="utf-8") == wanted:
        return python
    make = [sys.executable, "-m", "venv", str(folder)]
    pip = [str(python), "-m", "pip", "install", "--quiet", *PACKAGES]
    if any(subprocess.run(step, capture_output=True, check=False).returncode for step in (make, pip)):
        return "could not be installed"
    ready.write_text(wanted, encoding="utf-8")
    return python


def theirs(task: Task, rec: Records, P: Floats, tmp_path: Path) -> tuple[Outcome, float] | str:
    """The peer's filter, and us per sample; or why there is none."""
    python = environment()
    if isinstance(python, str):
        return python
    p, model = len(task.watched), AxisModel(three_mass("speed"), task.values, task.watched)
    A, B, _ = model.matrices()
    enters = zero_order_hold(A, B[:, :1], H)[1]
    Q, start = np.zeros((5 + p, 5 + p)), np.eye(5 + p) * 1e-4
    Q[:5, :5] = task.torque_noise**2 * enters @ enters.T
    Q[5:, 5:] = np.diag((1 - LAM) * P)
    theta0, watched = np.array([task.values[n] for n in NAMES]), [NAMES.index(n) for n in task.watched]
    file, out = tmp_path / "records.npz", tmp_path / "found.npz"
    np.savez(
        file, u=rec.u, y=rec.y, h=H, theta0=theta0, watched=watched, P0=start, Q=Q, R=task.output_noise**2
    )
    done = subprocess.run(
        [python, recursive_peers.__file__, file, out],
        capture_output=True, text=True, timeout=PATIENCE_S, check=False,
    )  # fmt: skip
    if done.returncode:
        return (done.stderr.strip().splitlines() or ["failed"])[-1][:80]
    return outcome(np.load(out)["theta"], task), float(done.stdout.split()[-1])


@pytest.mark.parametrize("name", TASKS)
def test_a_joint_filter_of_others(name: str, seed: int, say: Say, tmp_path: Path) -> None:
    task = TASKS[name]
    rec = records(task, seed)
    ours = {"axiswatch": Ours(task, rec, joint=False), "axiswatch, joint_state": Ours(task, rec, joint=True)}
    P = ours["axiswatch"].run(len(rec.u))[1]
    ours["axiswatch, joint_state, random_walk"] = Ours(task, rec, joint=True, drift=True, P=P)
    times = in_turns({who: it.alone() for who, it in ours.items()}, 9)
    rows: list[tuple[object, ...]] = []
    for who, it in ours.items():
        theta, _ = it.run(len(rec.u))
        rows.append((who, times[who] / SAMPLES * 1e6, *words(outcome(theta, task))))
    found = theirs(task, rec, P, tmp_path)
    cells = (found, *[""] * len(task.watched)) if isinstance(found, str) else (found[1], *words(found[0]))
    rows.append(("EKF of dynamax", *cells))
    say(
        f"{name}: scatter in per cent @ samples to 63 % of a change = scatter at a delay of 200 samples",
        ("", "us", *task.watched),
        rows,
    )


def words(found: Outcome) -> Sequence[str]:
    return [
        f"{s:.2f} @ {d:.0f} = {s * math.sqrt(d / 200):.2f}" if d < math.inf else f"{s:.2f} @ never"
        for s, d in zip(found.scatter, found.delay, strict=True)
    ]
