"""Answers of the API against its schema."""

from typing import Any

from jsonschema import Draft202012Validator


def matches_schema(answer: Any, operation: dict[str, Any], schema: dict[str, Any]) -> None:
    content = operation["responses"][str(answer.status_code)]["content"]
    body = {**schema, **content[answer.headers["content-type"]]["schema"]}
    validator = Draft202012Validator(body, format_checker=Draft202012Validator.FORMAT_CHECKER)
    validator.validate(answer.json())
    assert not validator.is_valid({**answer.json(), "more": 1})
