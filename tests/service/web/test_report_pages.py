"""The report of the commissioning, served beside the page: these files and no others, and nothing in them runs."""

from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from service.web.report_pages import ReportPages
from tests.service.web.conftest import Stage

REPORT = "<!doctype html><title>Commissioned robot</title><style>p { color: #123456 }</style><p>ready</p>"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """What ``commission`` leaves, with what is nobody's business."""
    made = tmp_path / "made"
    made.mkdir()
    for name in ("report.html", "demo.axis1-identification.html", "demo.axis1-calibration.html"):
        (made / name).write_text(REPORT, encoding="utf-8")
    for path in (made / "axiswatch.toml", made / "other.html", tmp_path / "secret.html"):
        path.write_text("secret", encoding="utf-8")
    return made


@pytest.fixture
def commissioned(stage: Stage, folder: Path) -> TestClient:
    stage.reports = ReportPages(folder, ["demo.axis1", "demo.axis2"])
    return stage.client()


def test_a_report_is_served_and_cannot_run_anything(commissioned: TestClient) -> None:
    for name in ("report.html", "demo.axis1-identification.html", "demo.axis1-calibration.html"):
        answer = commissioned.get(f"/reports/{name}")
        assert (answer.status_code, answer.text) == (200, REPORT)
        assert answer.headers["content-type"].startswith("text/html")
        policy = answer.headers["content-security-policy"].split("; ")
        assert {"default-src 'none'", "sandbox", "form-action 'none'", "base-uri 'none'"} <= set(policy)
        assert not any(part.startswith("script-src") for part in policy)
        assert answer.headers["x-content-type-options"] == "nosniff"
        assert commissioned.post(f"/reports/{name}").status_code == 405


def test_nothing_else_of_the_folder_is_served(commissioned: TestClient) -> None:
    for name in (
        "axiswatch.toml",
        "other.html",
        "demo.axis2-calibration.html",  # of an axis, but not there
        "../secret.html",
        "..%2fsecret.html",
        "%2e%2e/secret.html",
        "%2e%2e%2fsecret.html",
        "",
    ):
        answer = commissioned.get(f"/reports/{name}")
        assert answer.status_code == 404, name
        assert "secret" not in answer.text.replace("secret.html", "")


def test_the_service_names_the_report_where_there_is_one(
    stage: Stage, folder: Path, client: TestClient, commissioned: TestClient
) -> None:
    path = "/api/v1/service"
    assert client.get(path).json()["report"] is None
    assert client.get("/reports/report.html").status_code == 404
    address = commissioned.get(path).json()["report"]
    assert commissioned.get(address).text == REPORT
    (folder / "report.html").unlink()
    assert commissioned.get(path).json()["report"] is None
