"""The second half of the steps for a sample: innovation, update of theta and P, tests."""

from typing import Any, NamedTuple

from monitor_core.arrays import Floats, Ints
from monitor_core.kernel.admission import DOUBTED, GATED, IDLE, SEED, SETTLE, TRACK, Roles, form_innovation
from monitor_core.kernel.compile import kernel, part
from monitor_core.kernel.cusum import (
    Events,
    TestConstants,
    TestState,
    compute_deviations,
    note_crossings,
    update_cusum,
)
from monitor_core.kernel.evidence import EvidenceColumns, EvidenceState, Kept, gather_evidence
from monitor_core.kernel.outliers import (
    OutlierConstants,
    check_start,
    reject_outliers,
    update_running_variance,
)
from monitor_core.kernel.recursion import find_P0, update_P, update_theta
from monitor_core.kernel.state import GATED as GATED_COUNT
from monitor_core.kernel.state import OUTLIER, PROJECTED, SEEDING, SETTLING, STARVED, USED, State
from monitor_core.kernel.supervision import (
    FloorConstants,
    ParameterInformation,
    apply_information_floor,
    check_excitation,
    select_tests,
)
from monitor_core.kernel.tables import Constants


class Work(NamedTuple):
    """Arrays passed between the steps for a sample."""

    roles: Roles
    t: Ints  # (W,) time of the sample, us
    y: Floats  # (W,) its output
    yhat: Floats  # (W,) prediction
    eps: Floats  # (W,) innovation
    believed: Floats  # (W,) innovation that updates theta
    S: Floats  # (W,) lambda + psi' P psi
    lam: Floats  # (W,) forgetting factor over the interval
    psi: Floats  # (p, W)
    Ppsi: Floats  # (p, W)
    moved: Floats  # (p, W) change of theta
    d: Floats  # (p, W) deviation
    nu: Floats  # (p, W)
    hit: Ints  # (W,) whether a bound limited theta
    fit: Ints  # (W,) whether P was updated
    until: Ints  # (W,) samples until deviations are kept
    tested: Ints  # (p, W) which tests run
    floor: tuple[Floats, Floats, Floats]  # (p, p) each, scratch


@part
def update_estimates(lanes: Any, con: Constants, st: State, w: Work, X: Floats) -> None:
    """Update theta and P (eq. 11-13), or P(0), from the prediction."""
    roles, eps, S, lam, mode = w.roles, w.eps, w.S, w.lam, w.roles.mode
    # fmt: off
    check_excitation(lanes, lam, con.lam, con.min_excitation, S, st.excitation, mode, st.unobserved, st.observed)
    form_innovation(lanes, w.y, w.yhat, S, st.t, st.counts, roles, eps, X)
    limits = OutlierConstants(con.outlier, con.outlier_least, con.outlier_credit)
    reject_outliers(lanes, limits, lam, st.lam0_running, eps, S, st.credit, st.in_a_row, roles, w.believed)
    check_start(lanes, con.settle_us, con.interval, w.t, st.settled, st.in_a_row, st.counts, mode)
    update_theta(lanes, con.lower, con.upper, st.theta, st.observed, w.believed, w.Ppsi, S, roles.tracks, w.hit,
                 w.moved)
    update_P(lanes, lam, st.P, w.Ppsi, S, roles.learns, w.fit)
    find_P0(lanes, con.min_excitation, con.P_uninformed, con.seed, st.seed_left, st.P_nom, st.P, mode, st.observed)
    update_running_variance(lanes, lam, con.lam_slow, st.lam0_running, eps, S, mode)
    # fmt: on


@part
def update_tests(
    lanes: Any,
    con: Constants,
    st: State,
    w: Work,
    a0: int,
    reset: bool,
    kept: Kept,
    events: Events,
    noted: EvidenceColumns,
) -> None:
    """Classify parameters as observed or not, run the CUSUM tests (eq. 21-23), and gather evidence for the cause."""
    tracks, d, (N, L, Y) = w.roles.tracks, w.d, w.floor
    # fmt: off
    known = ParameterInformation(st.P, st.P_nom, st.since, st.unobserved, st.observed)
    floor = FloorConstants(con.floor, con.min_excitation, con.span, con.lam, con.scale)
    tests = TestConstants(con.theta0, con.alpha1, con.allowance, con.lam0, con.h, con.widen, con.naming_samples)
    cusum = TestState(st.theta, st.P, st.P_nom, st.shift, st.g, st.onset, st.left, st.noting)
    evidence = EvidenceState(st.theta, st.P, st.lam0_running, st.observed, st.left, st.noting, st.learned, con.span,
                             con.naming_samples)
    apply_information_floor(lanes, floor, known, tracks, N, L, Y)
    select_tests(lanes, con.tested, st.observed, st.theta, tracks, st.theta_seen, w.tested, st.tested)
    _tally(lanes, w.roles.mode, w.hit, st.counts, st.mode)
    compute_deviations(lanes, tests, cusum, d, w.nu)
    if update_cusum(lanes, con.h, w.t, st.g, st.onset, d, w.nu, w.tested):
        note_crossings(lanes, tests, cusum, w.t, w.tested, a0, reset, events)
    gather_evidence(lanes, evidence, w.t, w.until, d, tracks, a0, kept, events.filled, noted)
    # fmt: on


@kernel
def _tally(lanes: Any, mode: Ints, hit: Ints, counts: Ints, last: Ints) -> None:
    """Count the sample by its mode; ``last`` (W,) keeps the mode of lanes whose predictor runs."""
    for a in range(len(lanes)):
        last[a] = mode[a] if mode[a] >= SETTLE else last[a]
        counts[USED, a] += mode[a] == TRACK
        counts[SEEDING, a] += mode[a] == SEED
        counts[SETTLING, a] += mode[a] == SETTLE
        counts[GATED_COUNT, a] += mode[a] == GATED
        counts[OUTLIER, a] += mode[a] == DOUBTED
        counts[STARVED, a] += mode[a] == IDLE
        counts[PROJECTED, a] += hit[a]
