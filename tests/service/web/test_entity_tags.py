"""Entity tags: what has not changed is not sent again."""

import pytest
from fastapi.testclient import TestClient

from tests.service.web.conftest import FM_ALARM, Stage

ALARMS = "/api/v1/alarms"


def test_who_knows_the_answer_gets_none(client: TestClient) -> None:
    first = client.get(ALARMS)
    tag = first.headers["etag"]
    again = client.get(ALARMS, headers={"If-None-Match": tag})
    assert (again.status_code, again.content, again.headers["etag"]) == (304, b"", tag)
    assert "content-type" not in again.headers
    assert again.headers["x-content-type-options"] == "nosniff"


def test_what_has_changed_is_sent(client: TestClient, stage: Stage) -> None:
    tag = client.get(ALARMS).headers["etag"]
    stage.record("demo.axis2", "N m s/rad", 0.06, FM_ALARM)
    again = client.get(ALARMS, headers={"If-None-Match": tag})
    assert again.status_code == 200
    assert again.headers["etag"] != tag
    assert "demo.axis2" in again.text


@pytest.mark.parametrize("known", ["*", "W/{tag}", '"another", {tag}', ' {tag} , "b"'])
def test_ways_to_say_what_is_known(client: TestClient, known: str) -> None:
    tag = client.get(ALARMS).headers["etag"]
    assert client.get(ALARMS, headers={"If-None-Match": known.format(tag=tag)}).status_code == 304


@pytest.mark.parametrize("known", ['"another"', "", "no tag", '"*"'])
def test_who_knows_another_answer_gets_this_one(client: TestClient, known: str) -> None:
    first = client.get(ALARMS)
    again = client.get(ALARMS, headers={"If-None-Match": known})
    assert (again.status_code, again.content) == (200, first.content)


def test_head_has_the_tag_of_get(client: TestClient) -> None:
    assert client.head(ALARMS).headers["etag"] == client.get(ALARMS).headers["etag"]


def test_only_what_was_found_and_is_json_has_a_tag(client: TestClient) -> None:
    assert "etag" not in client.get("/api/v1/axes/nothing").headers
    assert "etag" not in client.get("/metrics").headers
    assert "etag" in client.get("/openapi.json").headers
