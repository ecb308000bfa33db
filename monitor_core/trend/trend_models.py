"""Trend models of a slow history and their evidence: least squares with priors, in closed form.

The models are a level and a change at a time c: a step, a ramp from c until now, or both.  The level has a flat prior;
changes are Gaussian around zero with the standard deviation ``size``.  Both are integrated out, which gives the
probability of each model, time and noise, and the joint Gaussian of level and slope at the end.
"""

from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats

BEFORE, AFTER = 2, 4
"""Numbers of entries needed before and after a change."""

PRIOR = {"steady": 0.4, "drift": 0.3, "step": 0.2, "both": 0.1}
KINDS = tuple(PRIOR)


class Shapes(NamedTuple):
    """The M possible changes, as columns (N, M)."""

    at: Floats  # (M,) times
    step: Floats  # (N, M) 0 before, 1 after
    ramp: Floats  # (N, M) 0 before, 1 at the end


class Weighed(NamedTuple):
    """All models with their weights and estimates; arrays (K,), or (K, 2) for step and ramp."""

    kind: Floats  # index in KINDS
    at: Floats  # time of the change
    log_weight: Floats
    level: Floats  # before the change, given the changes ``mean``
    level_variance: Floats  # given the changes
    pull: Floats  # (K, 2) decrease of the level for a change of one
    mean: Floats  # (K, 2) of step and ramp
    covariance: Floats  # (K, 2, 2)


def shapes(t: Floats, first: Floats) -> Shapes:
    """Changes just before the entries ``first`` (M,); 0: a change from the start of the history."""
    at = np.where(first > 0, (t[np.maximum(first - 1, 0)] + t[first]) / 2, t[0])
    step = (np.arange(len(t))[:, None] >= first).astype(float)
    ramp = np.maximum(t[:, None] - at, 0.0) / (t[-1] - at)
    return Shapes(at, step, ramp)


def weigh(W: Floats, log_det: Floats, s: Shapes, size: float, prior: Floats) -> Weighed:
    """Evidence and estimates of each trend model with each noise model.

    Args:
        W: whitened values, ones, steps and ramps (N, G, 2 + 2 M).
        log_det: log determinant of the covariance of each noise model (G,).
        s: the M changes; the first begins with the history, and has no step.
        size: prior standard deviation of a change.
        prior: prior probabilities of the times of the other changes (M - 1,).
    """
    M, (_, G, _) = len(s.at), W.shape
    y, ones, F = W[:, :, 0], W[:, :, 1], W[:, :, 2:].reshape(len(W), G, 2, M)
    a, b, c = (ones**2).sum(0), (ones * y).sum(0), (y**2).sum(0)
    af, bf = np.einsum("ng,ngfm->gfm", ones, F), np.einsum("ng,ngfm->gfm", y, F)
    aff = np.einsum("ngfm,nghm->gfhm", F, F)
    # Integrate out the level: project it out of all products.
    R = aff - np.einsum("gfm,ghm->gfhm", af, af) / a[:, None, None, None]
    r = bf - af * (b / a)[:, None, None]
    base = -0.5 * (log_det + np.log(a) + c - b**2 / a)
    # Step and ramp of each time side by side: the changes before the shapes.
    rest = _Projected(base, b / a, 1 / a, *(np.moveaxis(x, -1, 1) for x in (af / a[:, None, None], R, r)))
    models = [_steady(rest)]
    for kind, used in (("drift", (1,)), ("step", (0,)), ("both", (0, 1))):
        p = np.concatenate([[0.5 if kind == "drift" else 0.0], prior * (0.5 if kind == "drift" else 1.0)])
        models.append(_changed(kind, used, rest, s.at, size, p))
    return Weighed(*(np.concatenate(parts) for parts in zip(*models, strict=True)))


class _Projected(NamedTuple):
    """The evidence of each noise model once the level is integrated out, and what is left for M changes."""

    base: Floats  # (G,) log evidence without a change
    level: Floats  # (G,) its estimate without a change, and its variance
    level_variance: Floats
    pull: Floats  # (G, M, 2) decrease of the level for a change of one: step and ramp
    R: Floats  # (G, M, 2, 2) normal equations of step and ramp: R change = r
    r: Floats  # (G, M, 2)


def _steady(rest: _Projected) -> Weighed:
    G = len(rest.base)
    none = np.zeros((G, 2))
    weight = rest.base + np.log(PRIOR["steady"])
    return Weighed(np.zeros(G), np.zeros(G), weight, rest.level, rest.level_variance, none, none, np.zeros((G, 2, 2)))


def _changed(
    kind: str,
    used: tuple[int, ...],
    rest: _Projected,
    at: Floats,
    size: float,
    prior: Floats,
) -> Weighed:
    """One kind of change at all times, with all noise models (G M,)."""
    R, r, pull = rest.R.copy(), rest.r.copy(), rest.pull
    G, M = r.shape[:2]
    unused = [f for f in (0, 1) if f not in used]
    R[..., unused, :], R[..., :, unused], r[..., unused] = 0.0, 0.0, 0.0
    R[..., (0, 1), (0, 1)] += size**-2
    V: Floats = np.asarray(np.linalg.inv(R), float)
    mean = np.einsum("gmfh,gmh->gmf", V, r)
    gain = 0.5 * np.einsum("gmf,gmf->gm", mean, r) + 0.5 * np.log(np.linalg.det(V) * size**-4)
    V[..., unused, unused] = 0.0
    with np.errstate(divide="ignore"):
        weight = rest.base[:, None] + gain + np.log(PRIOR[kind] * prior)
    level_at = rest.level[:, None] - np.einsum("gmf,gmf->gm", pull, mean)
    flat = G * M
    return Weighed(
        np.full(flat, KINDS.index(kind)),
        np.tile(at, G),
        weight.ravel(),
        level_at.ravel(),
        np.repeat(rest.level_variance, M),
        pull.reshape(flat, 2),
        mean.reshape(flat, 2),
        V.reshape(flat, 2, 2),
    )


# --- Noise models: the scatter of a series around its trend -----------------------------------------------------------


# Each mean has three errors: the error of estimation, with variance s_k^2; white noise from hour to hour, which is the
# smaller the longer the mean; and persistent noise (temperature, load, a shift), with an exponential correlation in
# time.  The sizes of the noises and the correlation time are not known.  So a grid of noise models is used, each
# weighted by its likelihood, which determines the uncertainty of all results.  A Kalman filter with one state whitens
# the noise, for all models side by side.

LEVELS = (0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 0.95, 1.1, 1.3, 1.6, 2.0, 3.0)
"""Standard deviations of the total scatter, relative to the residuals of a simple trend."""

SHARES = (0.1, 0.3, 0.6, 0.85, 1.0)
"""Shares of the persistent noise in the variance."""

LASTING = 7
"""Number of correlation times, from the distance of two entries to half of the history (or to LONG, if longer)."""

LONG = 48.0
"""Correlation time of load and weather in hours, which a short history cannot show."""

FAVOUR = 0.5
"""Exponent of the correlation time in the prior, which favours long ones: persistent noise does more harm, and a short
history hardly shows it."""


class Noises(NamedTuple):
    """The G noise models, without the errors of estimation."""

    white: Floats  # variance of the white noise
    lasting: Floats  # variance of the persistent noise
    rate: Floats  # 1 / correlation time
    log_prior: Floats


def possible(t: Floats, level: float, hour: float) -> Noises:
    """Grid of noise models for entries at times t (N,) with a scatter of about ``level``."""
    times = np.geomspace(np.median(np.diff(t)), max((t[-1] - t[0]) / 2, LONG * hour), LASTING)
    variance = (level * np.array(LEVELS)) ** 2
    v, share, time = (x.ravel() for x in np.meshgrid(variance, SHARES, times, indexing="ij"))
    white = np.concatenate([[0.0], variance, v * (1 - share)])
    lasting = np.concatenate([np.zeros(1 + len(variance)), v * share])
    rate = np.concatenate([np.full(1 + len(variance), 1 / times[0]), 1 / time])
    favour = FAVOUR * np.log(time / times[0])
    return Noises(white, lasting, rate, np.concatenate([np.zeros(1 + len(variance)), favour]))


def whitened(t: Floats, columns: Floats, variance: Floats, share: Floats, noises: Noises) -> tuple[Floats, Floats]:
    """Columns (N, G, C) with the noise whitened to variance one, and log det of its covariance (G,).

    Args:
        t: increasing times (N,).
        columns: measured values and their explanatory columns (N, C).
        variance: variance of the errors of estimation (N,).
        share: share of the variance of the white noise that remains in the mean of an entry (N,).
        noises: the noise models.
    """
    G, (N, C) = len(noises.white), columns.shape
    m, P = np.zeros((G, C)), noises.lasting.copy()
    out, log_det = np.empty((N, G, C)), np.zeros(G)
    stays = np.exp(-np.diff(t, prepend=t[0])[:, None] * noises.rate)
    for k in range(N):
        m *= stays[k][:, None]
        P = noises.lasting + stays[k] ** 2 * (P - noises.lasting)
        S = P + variance[k] + noises.white * share[k]
        e = columns[k] - m
        m += (P / S)[:, None] * e
        P = P * (1 - P / S)
        out[k] = e / np.sqrt(S)[:, None]
        log_det += np.log(S)
    return out, log_det
