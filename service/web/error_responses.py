"""Answers to requests that fail: a body with the reason and the resources that exist."""

from collections.abc import Iterable

from fastapi import FastAPI, Request
from fastapi.responses import JSONResponse
from starlette.exceptions import HTTPException

from service.store.database import StoreError
from service.web.models import Problem


class UnknownResourceError(Exception):
    """The resource does not exist; ``known`` lists those that do."""

    def __init__(self, detail: str, known: Iterable[str]) -> None:
        self.problem = Problem(detail=detail, known=list(known))
        super().__init__(detail)


def add_handlers(app: FastAPI) -> None:
    """Answer with a ``Problem`` body on these errors."""

    @app.exception_handler(UnknownResourceError)
    async def not_known(_: Request, error: UnknownResourceError) -> JSONResponse:
        return _answer(404, error.problem)

    @app.exception_handler(StoreError)
    async def store_failed(_: Request, error: StoreError) -> JSONResponse:
        return _answer(503, Problem(detail=f"the alarm journal cannot be read: {error}"))

    @app.exception_handler(404)
    async def no_such_path(request: Request, _: HTTPException) -> JSONResponse:
        paths = [*app.openapi()["paths"], "/", "/docs", "/openapi.json"]
        return _answer(404, Problem(detail=f"there is nothing at {request.url.path}", known=sorted(paths)))


def _answer(status: int, problem: Problem) -> JSONResponse:
    return JSONResponse(problem.model_dump(), status_code=status)
