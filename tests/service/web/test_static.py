"""The files of the pages: all there, and none of them asks another host."""

from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from service.web.app import STATIC

FILES = ["/", "/docs", *(f"/static/{path.name}" for path in sorted(STATIC.iterdir()))]


@pytest.mark.parametrize("path", FILES)
def test_pages_forbid_what_they_do_not_need(path: str, client: TestClient) -> None:
    answer = client.get(path)
    assert answer.status_code == 200
    assert "default-src 'none'" in answer.headers["content-security-policy"]
    assert answer.headers["x-content-type-options"] == "nosniff"
    assert "://" not in answer.text.replace("http://www.w3.org/2000/svg", "")


def test_no_file_outside_is_served(client: TestClient) -> None:
    assert client.get("/static/../app.py").status_code == 404
    assert client.get("/static/%2e%2e/app.py").status_code == 404
    assert Path(STATIC / ".." / "app.py").exists()
