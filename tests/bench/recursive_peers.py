"""The joint extended Kalman filter of dynamax, on the records of test_recursive: runs alone, where dynamax is.

python recursive_peers.py RECORDS.npz OUT.npz: writes log(theta / theta0) (W, N, p) and prints us per sample.
The state is that of the drive and the logarithms of the watched parameters, a random walk.  The whole filter is
compiled by jax; the discretisation is exact, Jacobians are by automatic differentiation at the present estimates.
"""

from __future__ import annotations

import sys
from importlib import import_module
from time import perf_counter
from typing import Any

import numpy as np

N_STATES = 5


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


def filtered_by(data: Any) -> tuple[Any, float]:
    """Logarithms (W, N, p), and us per sample."""
    jax, jnp = import_module("jax"), import_module("jax.numpy")
    jax.config.update("jax_enable_x64", True)
    ssm = import_module("dynamax.nonlinear_gaussian_ssm")
    expm = import_module("jax.scipy.linalg").expm
    watched, theta0, h = data["watched"], jnp.array(data["theta0"]), float(data["h"])

    def moves(z: Any, u: Any) -> Any:
        theta = theta0.at[watched].multiply(jnp.exp(z[N_STATES:]), unique_indices=True)
        x = expm(generator(jnp, theta) * h) @ jnp.append(z[:N_STATES], u[0])
        return jnp.concatenate([x[:N_STATES], z[N_STATES:]])

    params = ssm.ParamsNLGSSM(
        initial_mean=jnp.zeros(N_STATES + len(watched)),
        initial_covariance=jnp.array(data["P0"]),
        dynamics_function=moves,
        dynamics_covariance=jnp.array(data["Q"]),
        emission_function=lambda z, _: z[2:3],
        emission_covariance=jnp.array([[float(data["R"])]]),
    )

    @jax.jit  # type: ignore[untyped-decorator]
    def run(u: Any, y: Any) -> Any:
        # There inputs[k] moves the state from k - 1 to k; "filtered" is after the measurement.
        before = jnp.append(0.0, u[:-1])[:, None]
        post = ssm.extended_kalman_filter(params, y[:, None], inputs=before)
        return post.filtered_means[:, N_STATES:]

    np.asarray(run(data["u"][0], data["y"][0]))  # compiles
    start = perf_counter()
    out = np.array([np.asarray(run(u, y)) for u, y in zip(data["u"], data["y"], strict=True)])
    return out, (perf_counter() - start) / data["u"].size * 1e6


if __name__ == "__main__":
    found, cost_us = filtered_by(dict(np.load(sys.argv[1])))
    np.savez(sys.argv[2], theta=found)
    print(cost_us)
