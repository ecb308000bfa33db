"""What others make of the record of test_identification: runs alone, by an interpreter that has the peers.

python peers.py RECORD.npz TOOL: prints one JSON object, seconds (one run behind a warm-up where compiling takes
long) and the fit of the simulation in per cent, with the parameters where the tool has physical ones.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from importlib import import_module
from time import perf_counter
from typing import Any

import numpy as np

ORDER = 5
BLOCK_ROWS = 20
ORDERS = {"SS_fixed_order": ORDER, "SS_f": BLOCK_ROWS, "SS_p": BLOCK_ROWS}
ADAM, LBFGS = 0, 300


def nrmse(simulated: Any, y: Any) -> float:
    return float(100 * (1 - np.linalg.norm(simulated - y) / np.linalg.norm(y - y.mean())))


def simulated(A: Any, B: Any, C: Any, D: Any, u: Any) -> Any:
    """From rest, by python-control."""
    control = import_module("control")
    return control.forced_response(control.ss(A, B, C, D, 1.0), U=u)[1].ravel()


def with_jax_sysid(data: Any) -> dict[str, Any]:
    """Grey box: logarithms of the parameters, exact zero-order hold by expm, gradients by autodiff, L-BFGS-B."""
    jax, jnp, models = import_module("jax"), import_module("jax.numpy"), import_module("jax_sysid.models")
    jax.config.update("jax_enable_x64", True)
    expm = import_module("jax.scipy.linalg").expm
    u, y, h = data["u"][:, None], data["y"][:, None], float(data["h"])
    size = float(y.std())

    def state(x: Any, v: Any, params: Any) -> Any:
        J1, J2, J3, k1, k2, d1, d2, f = jnp.exp(params[0])
        A = jnp.array(
            [
                [0, 0, 1, -1, 0],
                [0, 0, 0, 1, -1],
                [-k1 / J1, 0, -(d1 + f) / J1, d1 / J1, 0],
                [k1 / J2, -k2 / J2, d1 / J2, -(d1 + d2) / J2, d2 / J2],
                [0, k2 / J3, 0, d2 / J3, -d2 / J3],
            ]
        )
        B = jnp.array([[0.0], [0.0], [1 / J1], [0.0], [0.0]])
        held = expm(jnp.block([[A, B], [jnp.zeros((1, 6))]]) * h)
        return held[:5, :5] @ x + held[:5, 5:] @ v

    def output(x: Any, v: Any, params: Any) -> Any:
        return x[2:3] / size

    def run() -> Any:
        model = models.Model(5, 1, 1, state_fcn=state, output_fcn=output)
        model.init(params=[np.log(data["start"])], x0=np.zeros(5))
        model.loss(rho_x0=0.0, rho_th=0.0, train_x0=False)
        model.optimization(adam_epochs=ADAM, lbfgs_epochs=LBFGS, iprint=-1)
        model.fit(y / size, u)
        return model

    start = perf_counter()
    model = run()
    seconds = perf_counter() - start
    yhat = np.asarray(model.predict(np.zeros(5), u)[0]).ravel() * size
    theta = np.exp(np.asarray(model.params[0])).tolist()
    return {"seconds": seconds, "fit": nrmse(yhat, y.ravel()), "theta": theta}


def with_sippy(data: Any, method: str) -> dict[str, Any]:
    """Black box of order 5."""
    sippy = import_module("sippy_unipi")
    u, y = data["u"], data["y"]
    start = perf_counter()
    found = sippy.system_identification(y[None], u[None], method, **ORDERS)
    seconds = perf_counter() - start
    return {"seconds": seconds, "fit": nrmse(simulated(found.A, found.B, found.C, found.D, u), y)}


def with_nfoursid(data: Any) -> dict[str, Any]:
    """Black box of order 5."""
    pandas, nfoursid = import_module("pandas"), import_module("nfoursid.nfoursid")
    u, y = data["u"], data["y"]
    frame = pandas.DataFrame({"u": u, "y": y})
    start = perf_counter()
    tool = nfoursid.NFourSID(frame, output_columns=["y"], input_columns=["u"], num_block_rows=BLOCK_ROWS)
    tool.subspace_identification()
    found, _ = tool.system_identification(rank=ORDER)
    seconds = perf_counter() - start
    return {"seconds": seconds, "fit": nrmse(simulated(found.a, found.b, found.c, found.d, u), y)}


TOOLS: dict[str, Callable[[Any], dict[str, Any]]] = {
    "jax-sysid": with_jax_sysid,
    "SIPPY N4SID": lambda data: with_sippy(data, "N4SID"),
    "SIPPY PARSIM-K": lambda data: with_sippy(data, "PARSIM-K"),
    "nfoursid": with_nfoursid,
}


if __name__ == "__main__":
    print(json.dumps(TOOLS[sys.argv[2]](np.load(sys.argv[1]))))
