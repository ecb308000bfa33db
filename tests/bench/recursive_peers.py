"""The joint extended Kalman filter of others, on the records of test_recursive: runs alone, where the peers are.

python recursive_peers.py RECORDS.npz TOOL OUT.npz: writes log(theta / theta0) (W, N, p) and prints us per sample.
The state is that of the drive and the logarithms of the watched parameters, a random walk.  Discretisation and
Jacobian are exact, at the present estimates, as in the engine.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from importlib import import_module
from time import perf_counter
from typing import Any

import numpy as np

N_STATES = 5
SUBSTEPS, TERMS = 4, 12


def generator(xp: Any, theta: Any) -> Any:
    """[A B; 0 0] (6, 6) of the three masses for Jm Jg Ja kg ka dg da fm kT, everything on the motor side."""
    J1, J2, J3, k1, k2, d1, d2, f, kT = theta
    return xp.array(
        [
            [0, 0, 1, -1, 0, 0],
            [0, 0, 0, 1, -1, 0],
            [-k1 / J1, 0, -(d1 + f) / J1, d1 / J1, 0, kT / J1],
            [k1 / J2, -k2 / J2, d1 / J2, -(d1 + d2) / J2, d2 / J2, 0],
            [0, k2 / J3, 0, d2 / J3, -d2 / J3, 0],
            [0, 0, 0, 0, 0, 0],
        ]
    )


def with_filterpy(data: Any) -> tuple[Any, float]:
    """A step of the filter in filterpy, the model's in numba."""
    numba = import_module("numba")
    base = import_module("filterpy.kalman").ExtendedKalmanFilter
    watched, theta0, h = data["watched"], data["theta0"], float(data["h"])
    p, build = len(watched), numba.njit(generator_numba)

    @numba.njit  # type: ignore[untyped-decorator]
    def moved(z: Any, torque: float) -> Any:
        """Next state and Jacobian, by the Taylor series of the exponential and its derivatives."""
        n = N_STATES
        X, dX = build(theta0, watched, z[n:])
        V = np.zeros((6, n + p + 1))
        for r in range(n):
            V[r, r], V[r, n + p] = 1.0, z[r]
        V[n, n + p] = torque
        for _ in range(SUBSTEPS):
            T = V.copy()
            for k in range(1, TERMS + 1):
                U, x = X @ T, T[:, n + p].copy()
                for i in range(p):
                    U[:, n + i] += dX[i] @ x
                T = U * (h / SUBSTEPS / k)
                V += T
        F = np.eye(n + p)
        F[:n] = V[:n, : n + p]
        new = z.copy()
        new[:n] = V[:n, n + p]
        return new, F

    class Filter(base):  # type: ignore[misc, valid-type]
        x: Any

        def predict_x(self, u: Any = 0) -> None:
            new, self.F = moved(self.x[:, 0], float(u))
            self.x = new[:, np.newaxis]

    H = np.eye(N_STATES + p)[2:3]

    def run(u: Any, y: Any) -> Any:
        ekf = Filter(N_STATES + p, 1)
        ekf.x, ekf.P, ekf.R = np.zeros((N_STATES + p, 1)), data["P0"].copy(), float(data["R"])
        ekf.Q, out = data["Q"], np.empty((len(u), p))
        for k in range(len(u)):
            ekf.update(np.array([[y[k]]]), lambda _: H, lambda x: H @ x)
            out[k] = ekf.x[N_STATES:, 0]
            ekf.predict(u[k])
        return out

    run(data["u"][0][:50], data["y"][0][:50])
    return timed(run, data)


def generator_numba(theta0: Any, watched: Any, logs: Any) -> Any:
    """The same, and its derivatives by the logarithms of the watched parameters, as numba takes it."""
    theta = theta0.copy()
    for i in range(watched.size):
        theta[watched[i]] *= np.exp(logs[i])
    X, dX = np.zeros((6, 6)), np.zeros((watched.size, 6, 6))
    J1, J2, J3, k1, k2, d1, d2, f, kT = theta
    X[0, 2], X[0, 3], X[1, 3], X[1, 4] = 1.0, -1.0, 1.0, -1.0
    X[2, 0], X[2, 2], X[2, 3], X[2, 5] = -k1 / J1, -(d1 + f) / J1, d1 / J1, kT / J1
    X[3, 0], X[3, 1], X[3, 2], X[3, 3], X[3, 4] = k1 / J2, -k2 / J2, d1 / J2, -(d1 + d2) / J2, d2 / J2
    X[4, 1], X[4, 3], X[4, 4] = k2 / J3, d2 / J3, -d2 / J3
    for i in range(watched.size):
        D, j = dX[i], watched[i]
        if j < 3:
            D[2 + j] = -X[2 + j]
        elif j == 3:
            D[2, 0], D[3, 0] = -k1 / J1, k1 / J2
        elif j == 4:
            D[3, 1], D[4, 1] = -k2 / J2, k2 / J3
        elif j == 5:
            D[2, 2], D[2, 3], D[3, 2], D[3, 3] = -d1 / J1, d1 / J1, d1 / J2, -d1 / J2
        elif j == 6:
            D[3, 3], D[3, 4], D[4, 3], D[4, 4] = -d2 / J2, d2 / J2, d2 / J3, -d2 / J3
        elif j == 7:
            D[2, 2] = -f / J1
        else:
            D[2, 5] = kT / J1
    return X, dX


def with_dynamax(data: Any) -> tuple[Any, float]:
    """The whole filter compiled by jax, Jacobians by automatic differentiation."""
    jax, jnp = import_module("jax"), import_module("jax.numpy")
    jax.config.update("jax_enable_x64", True)
    ssm = import_module("dynamax.nonlinear_gaussian_ssm")
    expm = import_module("jax.scipy.linalg").expm
    watched, theta0, h = data["watched"], jnp.array(data["theta0"]), float(data["h"])

    def moves(z: Any, u: Any) -> Any:
        theta = theta0.at[watched].multiply(jnp.exp(z[N_STATES:]), unique_indices=True)
        x = expm(generator(jnp, theta) * h) @ jnp.append(z[:N_STATES], u[0])
        return jnp.concatenate([x[:N_STATES], z[N_STATES:]])

    size = N_STATES + len(watched)
    params = ssm.ParamsNLGSSM(
        initial_mean=jnp.zeros(size),
        initial_covariance=jnp.array(data["P0"]),
        dynamics_function=moves,
        dynamics_covariance=jnp.array(data["Q"]),
        emission_function=lambda z, _: z[2:3],
        emission_covariance=jnp.array([[float(data["R"])]]),
    )

    @jax.jit  # type: ignore[untyped-decorator]
    def filtered(u: Any, y: Any) -> Any:
        # There inputs[k] moves the state from k - 1 to k; "filtered" is after the measurement.
        before = jnp.append(0.0, u[:-1])[:, None]
        post = ssm.extended_kalman_filter(params, y[:, None], inputs=before)
        return post.filtered_means[:, N_STATES:]

    def run(u: Any, y: Any) -> Any:
        return np.asarray(filtered(u, y))

    run(data["u"][0], data["y"][0])
    return timed(run, data)


def timed(run: Callable[[Any, Any], Any], data: Any) -> tuple[Any, float]:
    """All records one after the other, and us per sample."""
    start = perf_counter()
    out = np.array([run(u, y) for u, y in zip(data["u"], data["y"], strict=True)])
    return out, (perf_counter() - start) / data["u"].size * 1e6


TOOLS: dict[str, Callable[[Any], tuple[Any, float]]] = {"filterpy": with_filterpy, "dynamax": with_dynamax}


if __name__ == "__main__":
    found, cost_us = TOOLS[sys.argv[2]](dict(np.load(sys.argv[1])))
    np.savez(sys.argv[3], theta=found)
    print(cost_us)
