"""The motions of the arm, which controllers send, from those of motors that also move with other axes."""

from collections.abc import Iterable, Mapping

import numpy as np

from service.can.user_errors import IngestError
from service.config.schema import NamedAxis


class ArmMotions:
    """Takes the coupling out of the motions of motors: the inverse of what is done to received motions.

    A coupled axis that has no motion at a moment is taken to be where it was; coupling with a signal is left in.
    """

    def __init__(self, axes: Iterable[NamedAxis]) -> None:
        self._factors = {
            axis.id: {f"{axis.robot}.{name}": factor for name, factor in axis.config.coupling.items()} for axis in axes
        }
        self._coupled = any(self._factors.values())
        self._last = dict[str, float]()

    def take(self, motors: Mapping[str, float]) -> Mapping[str, float]:
        """The motions of the arm at a moment, from those of the motors, by axis [rad or rad/s].

        Raises:
            IngestError: the axes are coupled in a circle in which the motors do not determine the arm.
        """
        if not self._coupled:
            return motors
        ids = list(motors)
        places = {axis_id: place for place, axis_id in enumerate(ids)}
        matrix, motions = np.eye(len(ids)), np.array([motors[axis_id] for axis_id in ids])
        for axis_id, place in places.items():
            for other, factor in self._factors[axis_id].items():
                if other in places:
                    matrix[place, places[other]] = factor
                else:
                    motions[place] -= factor * self._last.get(other, 0.0)
        try:
            arm = dict(zip(ids, np.linalg.solve(matrix, motions).tolist(), strict=True))
        except np.linalg.LinAlgError:
            raise IngestError(f"the coupling of {', '.join(ids)} is a circle: no arm has these motors") from None
        self._last |= arm
        return arm
