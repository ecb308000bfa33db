"""Answers of the API against its schema."""

from typing import Any

from jsonschema import Draft202012Validator


def obeys_schema(answer: Any, operation: dict[str, Any], schema: dict[str, Any]) -> None:
    content = operation["responses"][str(answer.status_code)]["content"]
    body = {**schema, **content[answer.headers["content-type"]]["schema"]}
    obeys = Draft202012Validator(body, format_checker=Draft202012Validator.FORMAT_CHECKER)
    obeys.validate(answer.json())
    assert not obeys.is_valid({**answer.json(), "more": 1})
