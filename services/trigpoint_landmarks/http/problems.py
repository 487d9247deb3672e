"""Every error as problem details (RFC 9457): what went wrong, without a word about the inside."""

import json
import logging
from collections.abc import Mapping
from http import HTTPStatus

from fastapi.exceptions import RequestValidationError
from starlette.exceptions import HTTPException
from starlette.responses import Response

from trigpoint.errors import AppendFailed, DatabaseUnavailable, InputError, TrigpointError
from trigpoint.observability.masking import without_password
from trigpoint_landmarks.http.ports import NoSuchName

PROBLEM_JSON = "application/problem+json"
DETAIL_LIMIT = 1000  # characters
RETRY_S = "1"

logger = logging.getLogger(__name__)


class Problem(Exception):
    """A request that is answered with a status and a reason, and no more."""

    def __init__(self, status: HTTPStatus, detail: str, headers: Mapping[str, str] | None = None) -> None:
        super().__init__(detail)
        self.status, self.detail, self.headers = status, detail, dict(headers or {})


def problem_response(problem: Problem) -> Response:
    """The problem as a response."""
    values = {
        "type": "about:blank",
        "title": problem.status.phrase,
        "status": problem.status.value,
        "detail": problem.detail[:DETAIL_LIMIT],
    }
    content = json.dumps(values, ensure_ascii=True).encode()
    headers = {"Cache-Control": "no-store", **problem.headers}
    return Response(content, problem.status.value, headers, PROBLEM_JSON)


def problem_of(error: Exception) -> Problem:
    """What a caller is told of an error; one nobody expected is logged, and its words are kept here."""
    match error:
        case Problem():
            return error
        case HTTPException():
            status = HTTPStatus(error.status_code)
            return Problem(status, str(error.detail), error.headers)
        case RequestValidationError():
            return Problem(HTTPStatus.UNPROCESSABLE_ENTITY, _validation_detail(error))
        case NoSuchName():
            return Problem(HTTPStatus.NOT_FOUND, str(error))
        case InputError():
            return Problem(HTTPStatus.BAD_REQUEST, without_password(str(error)))
        case DatabaseUnavailable() | AppendFailed():
            logger.warning("not answered now: %s", error)
            detail = "the database or the log is away or busy: try again"
            return Problem(HTTPStatus.SERVICE_UNAVAILABLE, detail, {"Retry-After": RETRY_S})
        case TrigpointError():
            logger.error("not answered: %s", error)
        case _:
            logger.error("unexpected %s", type(error).__name__, exc_info=error)
    return Problem(HTTPStatus.INTERNAL_SERVER_ERROR, "something failed here; it is in the service's log")


def _validation_detail(error: RequestValidationError) -> str:
    """What is wrong with a body, place by place."""
    said = [f"{'.'.join(str(step) for step in one['loc'])}: {one['msg']}" for one in error.errors()]
    return "; ".join(said)
