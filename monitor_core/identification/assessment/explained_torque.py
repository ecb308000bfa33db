"""Share of the measured torque that a drive with given values explains, from the measured motion in smooth means.

The torque that holds a weight is far larger than those of friction and inertia.  Then a simulation runs away with the
smallest error of that torque, and its speed says little about the values.  In the other direction nothing is
integrated:

    u = J w' + f w + fc tanh(w / scale) - (tau0 + weight of the pose) / kT + ..

with the values of the drive in slow motion, as one rigid mass.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.parameter_names import slope_name
from monitor_core.identification.problem import Problem
from monitor_core.identification.records.measured_record import Record
from monitor_core.identification.torque_balance.rigid_body import Balance, unexplained
from monitor_core.identification.torque_balance.torque_windows import SIGNAL, TorqueTerm
from monitor_core.kernel.tables import ANGLE_FUNCTIONS, COULOMB, OF_ANGLE, ONE, TORQUE

_MIN_FRICTION_SHARE = 0.5
"""Coulomb friction takes most of the torque above this share of the mean square of the torque."""
_SLOW = 0.05
"""Frequency [rad/s] of a motion that is slow enough to be rigid."""


def explained_torque(problems: Iterable[tuple[Problem, Sequence[Record]]]) -> float:
    """Explained torque in per cent, 100 (1 - |errors| / |torque - mean|), of the records of each problem.

    Scheduled parameters follow their signals where they are a constant torque.  -inf: nothing, or the records are too
    short.
    """
    left = spread = 0.0
    for problem, records in problems:
        found = unexplained(*_balanced(problem, records), problem.min_speed)
        if found is None:
            return -np.inf
        left, spread = left + found[0], spread + found[1]
    return 100 * (1 - float(np.sqrt(left / spread))) if spread > 0 else -np.inf


def holds_weight(problem: Problem) -> bool:
    """Whether a weight acts on the drive: gravity at its own angle, or a constant torque that follows the pose."""
    return problem.drive.acts(OF_ANGLE, problem.nominal) or follows_pose(problem)


def offset_exceeds_friction(problem: Problem) -> bool:
    """Whether a constant torque acts that exceeds Coulomb friction, as on a vertical linear axis."""
    kinds = np.array(problem.drive.inputs)
    if not ((kinds == ONE).any() and (kinds == COULOMB).any()):
        return False
    takes = _Rigid(problem).takes(problem.nominal)
    return abs(float(takes[kinds == ONE].sum())) > abs(float(takes[kinds == COULOMB].sum()))


def friction_dominates(problem: Problem, records: Iterable[Record]) -> bool:
    """Whether Coulomb friction takes most of the torque.

    Then the torque for acceleration and speed is the small difference of two large torques.  A friction with an error
    of a tenth, as by the temperature of the gear, may change a simulated speed by its whole value.
    """
    friction = np.array(problem.drive.inputs) == COULOMB
    if not friction.any():
        return False
    taken = float(_Rigid(problem).takes(problem.nominal)[friction].sum())
    u = np.concatenate([record.u for record in records])
    return taken**2 > _MIN_FRICTION_SHARE * float(u @ u) / max(u.size, 1)


def follows_pose(problem: Problem) -> bool:
    """Whether a constant torque follows signals, such as the angles of other axes."""
    return bool(problem.followed_torques)


def with_torque_of_pose(problem: Problem, records: Sequence[Record]) -> list[Record]:
    """The records, with the torque for gravity and signals added as the signal SIGNAL."""
    return _balanced(problem, records)[0]


def _balanced(problem: Problem, records: Sequence[Record]) -> tuple[list[Record], Balance, float]:
    """Records with the torque of pose and signals as a signal, the torque balance of the rest, and its speed scale."""
    drive, rigid = problem.drive, _Rigid(problem)
    kinds, ratio = np.array(drive.inputs), drive.matrix("ratio", problem.nominal)[:, 0]
    takes, scale = rigid.takes(problem.nominal), problem.speed_scale
    torques: dict[TorqueTerm, float] = {"viscous": rigid.viscous}
    if (friction := np.flatnonzero(kinds == COULOMB)).size:
        torques["coulomb"] = float(takes[friction].sum())
        scale /= abs(float(ratio[friction[0]]))
    if (kinds == ONE).any():
        torques["offset"] = float(takes[kinds == ONE].sum())
    posed = list[Record]()
    for record in records:
        pose = np.zeros(len(record))
        for name, signal in problem.followed_torques:
            slope = problem.slopes.get(slope_name(name, signal), 0.0)
            pose = pose + rigid.takes_per(name) * slope * record.signals[signal]
        for k, kind in enumerate(drive.inputs):
            if kind in ANGLE_FUNCTIONS:
                pose = pose + takes[k] * ANGLE_FUNCTIONS[kind](ratio[k] * record.y)
        known = np.isfinite(pose)
        filled = np.interp(record.t, record.t[known], pose[known]) if known.any() else np.zeros(len(record))
        posed.append(replace(record, signals={SIGNAL: filled}))
    if any(record.signals[SIGNAL].any() for record in posed):
        torques["signal"] = 1.0
    return posed, Balance(rigid.inertia, torques), scale


class _Rigid:
    """A drive in slow, rigid motion: the torque that its motion and its inputs need."""

    def __init__(self, problem: Problem) -> None:
        self._problem = problem
        A, B, C = AxisModel(problem.drive, problem.nominal, ()).matrices()
        s = 1j * _SLOW
        self._left = np.linalg.solve((s * np.eye(len(A)) - A).T, C[0].astype(complex))
        self._of_torque = (self._left @ B)[np.array(problem.drive.inputs) == TORQUE].sum()
        # 1 / (angle over torque) = J s^2 + f s
        impedance = (1 if problem.drive.output == "angle" else s) / self._of_torque
        self.inertia, self.viscous = -float(impedance.real) / _SLOW**2, float(impedance.imag) / _SLOW

    def takes(self, values: Mapping[str, float]) -> Floats:
        """Motor torque (m,) that one unit of each input needs."""
        takes: Floats = -np.real(self._left @ self._problem.drive.matrix("B", values) / self._of_torque)
        return takes

    def takes_per(self, name: str) -> float:
        """Motor torque that all inputs need per unit of a parameter."""
        nominal = self._problem.nominal
        more = self.takes({**nominal, name: nominal[name] + 1.0}) - self.takes(nominal)
        return float(more.sum())
