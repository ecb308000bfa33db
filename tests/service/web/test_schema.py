"""openapi.json: every field is explained, every answer is what it says."""

from dataclasses import replace
from typing import Any

import pytest
from fastapi.testclient import TestClient

from monitor_core.detection import Alarm
from tests.service.web.conftest import Stage

PATHS = {
    "/api/v1/service": "/api/v1/service",
    "/api/v1/axes": "/api/v1/axes",
    "/api/v1/axes/{axis}": "/api/v1/axes/demo.axis1",
    "/api/v1/axes/{axis}/history": "/api/v1/axes/demo.axis1/history",
    "/api/v1/axes/{axis}/trend": "/api/v1/axes/demo.axis1/trend",
    "/api/v1/alarms": "/api/v1/alarms",
    "/api/v1/alarms/{id}": "/api/v1/alarms/1",
    "/healthz": "/healthz",
    "/readyz": "/readyz",
}


@pytest.fixture
def schema(client: TestClient) -> dict[str, Any]:
    found: dict[str, Any] = client.get("/openapi.json").json()
    return found


def conforms(value: Any, schema: dict[str, Any], root: dict[str, Any]) -> bool:
    """As much of JSON schema as the answers use; a construct that is not known here fails."""
    if "$ref" in schema:
        return conforms(value, root["components"]["schemas"][schema["$ref"].split("/")[-1]], root)
    if "anyOf" in schema:
        return any(conforms(value, one, root) for one in schema["anyOf"])
    if "enum" in schema:
        return value in schema["enum"]
    match schema["type"]:
        case "object" if "properties" in schema:
            assert schema["additionalProperties"] is False
            fits = isinstance(value, dict) and value.keys() == schema["properties"].keys()
            return fits and all(
                conforms(value[name], one, root) for name, one in schema["properties"].items()
            )
        case "object":
            return all(conforms(one, schema["additionalProperties"], root) for one in value.values())
        case "array":
            return isinstance(value, list) and all(conforms(one, schema["items"], root) for one in value)
        case "number":
            return isinstance(value, int | float)
        case "integer":
            return isinstance(value, int)
        case "boolean":
            return isinstance(value, bool)
        case "null":
            return value is None
        case "string":
            return isinstance(value, str) and (schema.get("format") != "date-time" or value.endswith("Z"))
        case kind:
            raise AssertionError(kind)


@pytest.mark.parametrize(("path", "request_path"), PATHS.items(), ids=list(PATHS))
def test_answers_are_what_the_schema_says(
    path: str,
    request_path: str,
    stage: Stage,
    client: TestClient,
    schema: dict[str, Any],
    fm_alarm: Alarm,
) -> None:
    stage.journal.record("demo.axis1", "N m s/rad", 0.06, replace(fm_alarm, ended_us=fm_alarm.updated_us))
    stage.journal.record("demo.axis1", "N m s/rad", 0.06, replace(fm_alarm, raised_us=0))
    answer = client.get(request_path)
    described = schema["paths"][path]["get"]["responses"][str(answer.status_code)]
    body_schema = described["content"]["application/json"]["schema"]
    assert conforms(answer.json(), body_schema, schema)
    assert not conforms({**answer.json(), "more": 1}, body_schema, schema)


def test_all_paths_are_covered(schema: dict[str, Any]) -> None:
    assert set(schema["paths"]) == {*PATHS, "/metrics"}


def test_numbers_tell_their_unit_or_what_they_count(schema: dict[str, Any]) -> None:
    silent = [
        f"{name}.{field}"
        for name, body in schema["components"]["schemas"].items()
        for field, described in body.get("properties", {}).items()
        if "number" in str(described.get("type", described.get("anyOf"))) and "description" not in described
    ]
    assert silent == []


def test_operations_are_explained(schema: dict[str, Any]) -> None:
    for path, methods in schema["paths"].items():
        assert set(methods) == {"get"}, path
        assert methods["get"]["summary"], path
        assert methods["get"]["description"], path
