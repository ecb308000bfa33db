"""Answers to failed requests: problem details (RFC 9457), and their descriptions in the schema."""

from collections.abc import Iterable, Mapping, Sequence
from http import HTTPStatus
from typing import Any

from fastapi import FastAPI
from fastapi.responses import JSONResponse

from monitor_core.wording import Sentence, joined
from service.config.problems import at_place
from service.web.models import Problem, sentence_bodies

MEDIA_TYPE = "application/problem+json"


class UnknownResourceError(Exception):
    """The resource does not exist; ``known``: existing resources."""

    def __init__(self, detail: str, known: Iterable[str]) -> None:
        self.detail, self.known = detail, tuple(known)
        super().__init__(detail)


def answer(
    status: int, detail: str, known: Iterable[str] = (), headers: Mapping[str, str] | None = None
) -> JSONResponse:
    """The answer to a failed request."""
    title = HTTPStatus(status).phrase
    own = sentence_bodies((detail,))
    problem = Problem(title=title, status=status, detail=detail, sentences=own, known=list(known))
    return JSONResponse(problem.model_dump(), status_code=status, headers=headers, media_type=MEDIA_TYPE)


def mistakes(errors: Sequence[Any]) -> str:
    """The validation errors of a request in words.

    Values are left out: some cannot be written as JSON (NaN, half a surrogate pair), and some may be secrets.
    """
    found = [_mistake(error) for error in errors]
    known = all(isinstance(words, Sentence) for words in found)
    return joined(found) if known else "; ".join(found)


def _mistake(error: Mapping[str, Any]) -> str:
    if error["type"] == "json_invalid":
        return f"the body is no JSON: {error['ctx']['error']}, at character {error['loc'][-1]}"
    place = ".".join(map(str, error["loc"][1:])) or str(error["loc"][0])
    return at_place(place, error)


def described(status: int, description: str) -> dict[int | str, dict[str, Any]]:
    """The description of an error answer for the schema of a route."""
    content = {MEDIA_TYPE: {"schema": {"$ref": f"#/components/schemas/{Problem.__name__}"}}}
    return {status: {"description": description, "content": content}}


NOT_FOUND = described(404, "It does not exist")
PROTECTED = described(401, "There are tokens, and none was given, or an unknown one") | described(
    403, "Its scope is too small"
)
"""Error answers of every route that needs a token"""


_MISTAKEN = described(422, "A parameter or the body is not as described; detail says which, and what would be right")[
    422
]
_NO_TEXT = described(400, "The body is no UTF-8 text")[400]
"""Error answer of FastAPI itself, for every route with a body"""
_UNCHANGED = {"description": "If-None-Match has the ETag of the answer: it is as before, and there is no body"}


def add_to_schema(app: FastAPI) -> None:
    """Add the body of error answers to the schema, as FastAPI adds only bodies of type application/json."""
    described_alone = app.openapi

    def openapi() -> dict[str, Any]:
        schema = described_alone()
        problem = Problem.model_json_schema(ref_template="#/components/schemas/{model}")
        problem.pop("$defs")  # the schema has them already
        schema["components"]["schemas"][Problem.__name__] = problem
        operations = (operation for path in schema["paths"].values() for operation in path.items())
        for unused in ("HTTPValidationError", "ValidationError"):
            schema["components"]["schemas"].pop(unused, None)
        for hook in schema.get("webhooks", {}).values():
            hook["post"]["responses"].pop("422", None)  # the receiver decides what it answers
        for method, operation in operations:
            if method == "get" and "application/json" in operation["responses"].get("200", {}).get("content", {}):
                operation["responses"]["304"] = _UNCHANGED
            if "application/json" in operation["responses"].get("422", {}).get("content", {}):
                operation["responses"]["422"] = _MISTAKEN
            if "requestBody" in operation:
                operation["responses"] = {"400": _NO_TEXT} | operation["responses"]
        return schema

    app.openapi = openapi  # type: ignore[method-assign]
