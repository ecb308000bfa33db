"""What commissioning looks at of the identification of an axis, made up, and configurations of this axis."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from monitor_core.identification import (
    Effect,
    FitQuality,
    LinkWeights,
    Obstacle,
    Rejection,
    Watched,
)
from monitor_core.identification.parameter_selection import ScheduledTerm
from service.commands.commissioning.axis.load_search import LinkLoad
from service.config.written.corrections import Correction

TEXT = """
[[robot]]
name = "cell"
[[robot.axis]]
name = "a1"
sample_interval_s = 0.005
torque = { column = "u" }
angle = { column = "phi" }
model = { drive = "three-mass", monitor = ["kT", "1/Ja", "fm"], nominal = { kT = 1, r = 0.01, Jg = 3.0 } }
"""

MASS = TEXT.replace('"three-mass", monitor = ["kT", "1/Ja", "fm"]', '"one-mass", monitor = ["kT", "fm"]').replace(
    ", r = 0.01, Jg = 3.0 }", " }"
)

TWO = MASS + MASS[MASS.index("[[robot.axis]]") :].replace('"a1"', '"a2"')

NAME = "cell.a1"


def report(
    *watched: Watched,
    rejection: str | None = None,
    follows: tuple[str, ...] = (),
    missing: tuple[Effect, ...] = (),
    quality: FitQuality = FitQuality.GOOD,
) -> Any:
    """What is looked at of an identification."""
    scheduled = [SimpleNamespace(parameter=name) for name in follows]
    estimate = SimpleNamespace(drive=SimpleNamespace(constant_torques=lambda: ("tau0",)), moving=())
    result = SimpleNamespace(
        watched=watched,
        options=SimpleNamespace(scheduled=scheduled),
        memory_s=5.0,
        verdict=SimpleNamespace(missing=missing, slow=0.1, quality=quality),
        estimate=estimate,
        slow_left_out=0.0,
        not_following=(),
        warm_up=None,
        rejection=Rejection.POOR if rejection else None,
    )
    return SimpleNamespace(
        rejection=rejection, result=result, outlook="", obstacles="", warnings=(), is_poor=bool(missing)
    )


KT, FM = Watched("kT", 0.1, None), Watched("fm", 0.2, None)

NO_FM = Watched("fm", np.nan, Obstacle.NO_SIZE)


def load_of(changes: tuple[Correction, ...], *terms: str, explained: float = 0.9, before: float = 0.3) -> LinkLoad:
    """A load of links with these terms, which explain this share of the torque."""
    return LinkLoad(LinkWeights(terms, explained, before), changes)


def unsettled(*moving: str) -> Any:
    """A fit with four terms of the torque offset that has not converged, as these parameters would still move."""
    found = report(KT, rejection="the fit has not converged")
    found.result.rejection, found.result.estimate.moving = Rejection.NOT_CONVERGED, moving
    terms = ("cos(a2)", "a2-acceleration", "a2-acceleration * cos(a2)", "a2-acceleration * sin(a2)")
    found.result.options.scheduled = [ScheduledTerm("tau0", term, 0.0, -1.0, 1.0) for term in terms]
    return found
