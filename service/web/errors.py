"""Requests that cannot be answered: a body that says what is wrong and what there is instead."""

from collections.abc import Iterable

from fastapi import FastAPI, Request
from fastapi.responses import JSONResponse
from starlette.exceptions import HTTPException

from service.store.database import StoreError
from service.web.models import Problem


class NotKnownError(Exception):
    """There is no such thing; ``known`` are those that there are."""

    def __init__(self, what: str, known: Iterable[str]) -> None:
        self.problem = Problem(detail=what, known=list(known))
        super().__init__(what)


def add_handlers(app: FastAPI) -> None:
    """Let the app answer with a Problem."""

    @app.exception_handler(NotKnownError)
    async def not_known(_: Request, error: NotKnownError) -> JSONResponse:
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
