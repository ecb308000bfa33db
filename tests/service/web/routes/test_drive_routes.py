"""The drive of an axis over the API: components, where the monitored parameters are, frequency responses."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient

from monitor_core.drive import AxisModel
from monitor_core.modeling import drive_of, eliminate
from monitor_core.modeling.drawing import Drawing, part
from monitor_core.modeling.laurent import Laurent
from monitor_core.modeling.resonances import resonances
from monitor_core.settings import Settings
from service.pipeline.axes.axis_pipeline import MonitoredDrive
from tests.service.web.conftest import Stage
from tests.service.web.watched_drives import MODEL, reference, watch

AXIS = "/api/v1/axes/demo.axis1"
STIFF = Drawing(
    "stiff",
    [
        part("torque", "drive", "shaft"),
        part("inertia", "rotor", "shaft", J="Jm"),
        part("inertia", "flange", "arm", J="Ja"),
        part("ideal-gear", "gear", "shaft", "arm", ratio=Laurent.symbol("r", -1)),
        part("viscous-friction", "bearing", "shaft", d="fm"),
        part("angle-sensor", "encoder", "shaft"),
    ],
).flat()
"""Both inertias turn together: only their sum can be monitored."""


def test_every_parameter_is_in_a_component_that_has_its_place(client: TestClient, stage: Stage) -> None:
    watch(stage, reference())
    answer = client.get(f"{AXIS}/model").json()
    assert (answer["axis"], answer["drive"]) == ("demo.axis1", "three-mass")
    by_name = {c["name"]: c for c in answer["components"]}
    spring, gear, motor, arm = (by_name[name] for name in ("arm_spring", "gear", "motor", "arm"))
    assert (spring["kind"], gear["kind"]) == ("spring-damper", "ideal-gear")
    assert [(p["role"], p["text"]) for p in spring["parameters"]] == [("c", "ka"), ("d", "da")]
    assert gear["parameters"] == [{"role": "ratio", "text": "1/r", "names": ["r"]}]
    assert set(motor["nodes"]) & set(gear["nodes"])
    assert set(arm["nodes"]) & set(spring["nodes"])
    drawn = {name for c in answer["components"] for p in c["parameters"] for name in p["names"]}
    assert drawn == {p.name for p in MODEL.drive.parameters}
    assert answer["monitored"] == [
        {"name": "kT", "names": ["kT"]},
        {"name": "1/Ja", "names": ["Ja"]},
        {"name": "fm", "names": ["fm"]},
    ]


def test_a_merged_parameter_is_in_all_components_it_is_merged_from(client: TestClient, stage: Stage) -> None:
    drive = drive_of(eliminate(STIFF, "angle"))
    (merged,) = (d.name for d in drive.definitions if "Ja" in d.names)
    model = AxisModel(drive, {"Jm": 0.01, "Ja": 2.0, "r": 0.01, "fm": 0.1, "drive.kT": 1.0}, (merged,))
    watch(stage, MonitoredDrive(model, Settings(0.005), STIFF.components))
    answer = client.get(f"{AXIS}/model").json()
    assert answer["monitored"] == [{"name": merged, "names": ["Ja", "Jm", "r"]}]
    assert client.get(f"{AXIS}/bode").json()["resonances"] == []


def response(frequency_hz: np.ndarray[Any, Any], values: dict[str, float], delay_s: float) -> np.ndarray[Any, Any]:
    """G of the drive with its torque held over an interval and late: by the matrix exponential, sample for sample."""
    from scipy.linalg import expm

    A, B, C = AxisModel(MODEL.drive, values, ()).matrices()
    b, n, h = B[:, MODEL.drive.inputs.index(0)], len(A), 0.005
    joined = np.zeros((n + 1, n + 1))
    joined[:n, :n], joined[:n, n] = A, b

    def held(duration_s: float) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
        e = expm(joined * duration_s)
        return e[:n, :n], e[:n, n]

    rest, new = held(h - delay_s)
    _, old = held(delay_s)
    z = np.exp(2j * np.pi * frequency_hz * h)
    return np.array([C[0] @ np.linalg.solve(at * np.eye(n) - held(h)[0], new + rest @ old / at) for at in z])


@pytest.mark.parametrize("delay_s", [0.0, 0.0012])
def test_the_responses_are_those_of_the_nominal_and_of_the_present_values(
    delay_s: float, client: TestClient, stage: Stage
) -> None:
    changed = {"kT": 0.9, "1/Ja": 1.25 / MODEL.nominal["Ja"], "fm": 0.09}
    watch(stage, reference(delay_s=delay_s), **changed)
    answer = client.get(f"{AXIS}/bode").json()
    f = np.array(answer["frequency_hz"])
    assert f.max() < 100
    now = {**MODEL.nominal, "kT": 0.9, "Ja": MODEL.nominal["Ja"] / 1.25, "fm": 0.09}
    for name, values in (("nominal", dict(MODEL.nominal)), ("present", now)):
        G = response(f, values, delay_s)
        assert answer[name]["magnitude_db"] == pytest.approx(20 * np.log10(np.abs(G)), abs=1e-3)
        turns = (np.array(answer[name]["phase_deg"]) - np.degrees(np.angle(G))) / 360
        assert turns == pytest.approx(np.round(turns), abs=1e-4)
    assert (answer["unit"], answer["without_estimate"]) == ("rad per N m", [])
    was, is_now = ([m.frequency_hz for m in resonances(*parts(v)).resonances] for v in (dict(MODEL.nominal), now))
    assert [r["nominal_hz"] for r in answer["resonances"]] == pytest.approx(was, rel=1e-6)
    assert [r["present_hz"] for r in answer["resonances"]] == pytest.approx(is_now, rel=1e-6)
    assert is_now[0] > 1.02 * was[0]  # a lighter arm


def test_the_band_is_that_of_the_covariance_of_the_estimates(client: TestClient, stage: Stage) -> None:
    """The torque constant scales the response; of a parameter without an estimate nothing is in the band."""
    watch(stage, reference(), fm=math.nan)
    assert client.get(f"{AXIS}/bode").json()["magnitude_sd_db"] == []
    (axis,) = stage.snapshot.axes
    P = ((1e-4, 0.0, 0.01), (0.0, 0.0, 0.0), (0.01, 0.0, 1e9))
    stage.snapshot = replace(stage.snapshot, axes=(replace(axis, status=replace(axis.status, covariance=P)),))
    answer = client.get(f"{AXIS}/bode").json()
    sd = 20 / math.log(10) * 0.01
    assert answer["magnitude_sd_db"] == pytest.approx([sd] * len(answer["frequency_hz"]), abs=1e-4)
    assert answer["phase_sd_deg"] == pytest.approx([0.0] * len(answer["frequency_hz"]), abs=1e-4)


def parts(values: dict[str, float]) -> tuple[Any, Any, Any]:
    A, B, C = AxisModel(MODEL.drive, values, ()).matrices()
    return A, B[:, MODEL.drive.inputs.index(0)], C[0]


def test_a_parameter_without_an_estimate_is_nominal_and_that_is_stated(client: TestClient, stage: Stage) -> None:
    watch(stage, reference(), fm=math.nan, kT=1.1)
    answer = client.get(f"{AXIS}/bode").json()
    assert answer["without_estimate"] == ["fm"]
    rise = np.subtract(answer["present"]["magnitude_db"], answer["nominal"]["magnitude_db"])
    assert rise == pytest.approx(20 * math.log10(1.1), abs=1e-3)


def test_estimates_that_no_drive_can_have_give_no_present_response(client: TestClient, stage: Stage) -> None:
    watch(stage, reference(), kT=-1.0)
    answer = client.get(f"{AXIS}/bode").json()
    assert answer["present"] is None
    assert len(answer["nominal"]["magnitude_db"]) == len(answer["frequency_hz"])
    assert {r["present_hz"] for r in answer["resonances"]} == {None}


def test_a_drive_that_is_not_known_is_refused(client: TestClient) -> None:
    for name in ("model", "bode"):
        answer = client.get(f"{AXIS}/{name}")
        assert (answer.status_code, answer.headers["retry-after"]) == (503, "5")
        assert client.get(f"/api/v1/axes/nothing/{name}").status_code == 404
