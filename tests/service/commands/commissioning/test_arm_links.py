"""The arm of the soaks: what its axes follow beyond the weight, as commissioning finds it."""

from pathlib import Path

import numpy as np

from monitor_core.drive import Term
from tests.core.arm import Arm, redrawn
from tests.service.arm_cell import SIGNALS, WEIGHTS, link_terms, write


def test_the_torque_offsets_follow_what_it_takes_to_move_the_links(tmp_path: Path, seed: int) -> None:
    """Without that, changes of fm of the elbow would show from some 60 % on instead of 20 %."""
    rng = np.random.default_rng(seed)
    record = write(tmp_path / "record.csv", Arm(redrawn(rng), rng).take(600.0))
    for axis, text in link_terms(tmp_path, [record]).items():
        terms = [Term.read(term) for term in text.split(", ")]
        weights = {Term.read(weight) for weight in WEIGHTS[axis].split(", ")}
        assert weights <= set(terms)
        signals = {signal for term in terms for signal in term.signals}
        assert signals <= SIGNALS.keys()
        other = "elbow" if axis == "shoulder" else "shoulder"
        # M_12(q) q'' of the other axis: a constant part, or one that follows the pose of the elbow.
        assert f"{other}-acceleration" in signals
        assert any({f"{other}-acceleration", "elbow"} <= set(term.signals) for term in terms)
