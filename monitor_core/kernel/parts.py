"""What a second process compiles on a cold start, while the first is at what else there is in ``run``.

These functions are cached by themselves, in the order in which the first process needs them.  It gets to the last of
them when half of its work is done; what is here must not take longer.
"""

from typing import Any

import numpy as np

from monitor_core.arrays import Floats, Ints
from monitor_core.kernel.admission import Roles
from monitor_core.kernel.compile import compile_part
from monitor_core.kernel.cusum import Events
from monitor_core.kernel.evidence import EvidenceColumns
from monitor_core.kernel.friction import MiddleSpeed, hold_friction
from monitor_core.kernel.state import constant_views, state_views
from monitor_core.kernel.tables import Tables
from monitor_core.kernel.taylor_series import advance_one
from monitor_core.kernel.update import Work, update_tests


def compile_parts(
    lanes: Any,
    tables: Tables,
    C: Floats,
    F: Floats,
    I: Ints,
    kept_t: Ints,
    kept_d: Floats,
    reset: bool,
    events: Events,
    noted: EvidenceColumns,
) -> None:
    """Compile them for one axis and the arguments of ``run``, or load them from the cache."""
    n, p, m, W = tables.n, tables.p, tables.m, len(lanes)
    con, st = constant_views(C[:, :W].copy(), tables), state_views(F[:, :W].copy(), I[:, :W].copy(), n, p, m)
    x, xs, N, k, ks = (
        np.zeros(W),
        np.zeros((p, W)),
        np.zeros((p, p)),
        np.zeros(W, np.int64),
        np.zeros((p, W), np.int64),
    )
    w = Work(Roles(k, k, k, k), k, x, x, x, x, x, x, x, xs, xs, xs, xs, xs, k, k, k, ks, (N, N, N))
    du, middle = np.zeros((p, m, W)), MiddleSpeed(xs, x, x, x, x, xs, xs, xs)
    compile_part(
        hold_friction, lanes, tables.friction, tables.kind, con.u_scale, xs, x, x, x, xs, xs, du, middle
    )
    compile_part(advance_one, tables.product, x, x, 0.0, 0, 0, x, x, x)
    compile_part(update_tests, lanes, con, st, w, 0, reset, kept_t, kept_d, events, noted)
