"""`/labs:run`: simulates a lab on the server and returns the recording."""

import gzip
import hashlib
import json
from collections.abc import Callable
from functools import partial
from typing import Annotated, Any, Self

import structlog
from fastapi import Header
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import Response
from pydantic import BaseModel, ConfigDict, Field, StrictBool, StrictFloat, StrictInt, StrictStr, model_validator

from grader.api.bodies import RequestBody
from grader.courses.answering.access import read_access
from grader.courses.people.identity import Identity
from grader.domain.lab import Lab, LabConfig, UnknownLab
from grader.errors import Conflict, LabError, NotFound, Unprocessable
from grader.gate.callers import Learner, api_router
from grader.gate.lab_runs import Recording
from grader.gate.problems import refusals
from grader.gate.services import AppServices, Services
from grader.labs import PULLS_MAX, LabRequest, Pull, lab_kind_of
from grader.library import Library
from grader.questions import kind_of

router = api_router("labs")

log = structlog.get_logger()

GZIP_LEVEL = 5
"""Saves nearly as much as level 9, at a third of the time."""

Setting = StrictBool | StrictInt | StrictFloat | StrictStr


Coordinates = tuple[float, float, float]


class PullBody(BaseModel):
    """A body is pulled: a spring from a point of the drawn geom number `geom`, in the geom's own frame, to a goal in
    the world [m], from `begin` until `end` [s]."""

    model_config = ConfigDict(
        extra="forbid", allow_inf_nan=False,
        json_schema_extra={"examples": [
            {"geom": 2, "point": [0, 0, 0], "goal": [0.5, 0, 1], "begin": 0.1, "end": 0.4},
        ]},
    )  # fmt: skip

    geom: int = Field(ge=0, strict=True)
    point: Coordinates
    goal: Coordinates
    begin: float
    end: float


class LabBody(RequestBody):
    """Which lab, with the values of its controls, and the length of the run [s]. `events` are presses of buttons: time
    [s] and label."""

    quiz: str = Field(max_length=64)
    question: str | None = Field(default=None, max_length=64)
    lab: str | None = Field(default=None, max_length=64)
    controls: dict[str, Setting] = Field(default_factory=dict, max_length=100)
    events: list[tuple[StrictInt | StrictFloat, StrictStr]] = Field(default_factory=list, max_length=1000)
    pulls: list[PullBody] = Field(default_factory=list, max_length=PULLS_MAX)
    seconds: float | None = None

    @model_validator(mode="after")
    def _question_or_lab(self) -> Self:
        if (self.question is None) == (self.lab is None):
            raise ValueError("give either a question or a lab")
        return self


@router.post("/labs:run", responses=refusals(401, 403, 404, 409, 413, 422, 429, more={200: {"model": dict[str, Any]}}))
async def run_lab(
    body: LabBody, who: Learner, services: AppServices, accept_encoding: Annotated[str, Header()] = ""
) -> Response:
    """Runs a lab: poses, readouts, traces, and warnings with their time. 409 before the question is answered."""
    digest, make = await run_in_threadpool(prepare, services, who, body)
    return await respond(await services.labs.get((who.course, who.id), digest, make), accept_encoding)


async def respond(packed: bytes, accept_encoding: str) -> Response:
    """Returns compressed JSON, as it is where the caller takes that."""
    headers = {"Vary": "Accept-Encoding"}
    if "gzip" not in accept_encoding:
        plain = await run_in_threadpool(gzip.decompress, packed)
        return Response(plain, media_type="application/json", headers=headers)
    return Response(packed, media_type="application/json", headers={**headers, "Content-Encoding": "gzip"})


def prepare(services: Services, who: Identity, body: LabBody) -> tuple[str, Callable[[], Recording]]:
    """The digest of a run, and the call that makes it. Raises NotFound, Conflict."""
    library = services.library_for(who)
    services.require_opened(library, who, body.quiz)
    lab = find_lab(library, body)
    if body.question is not None:
        refuse_before_answer(services, who, body.quiz, body.question)
    posed = lab.model_dump_json() if library is not services.content.get(who.course).library else ""
    settings = json.dumps([library.digest(body.quiz), posed, body.model_dump()], sort_keys=True)
    digest = hashlib.sha256(settings.encode(errors="surrogatepass")).hexdigest()
    return digest, partial(record, library, lab, body)


def find_lab(library: Library, body: LabBody) -> Lab | LabConfig:
    """The lab that the body names. Raises NotFound, Unprocessable for a lab of an unknown kind."""
    if body.question is not None:
        question = library.question(body.quiz, body.question)
        if (own := kind_of(question).lab(question)) is not None:
            return own
        raise NotFound(f"Question {body.question!r} has no lab.")
    for lab in library.quiz(body.quiz).labs:
        if lab.id == body.lab and not isinstance(lab, UnknownLab):
            return lab
        if lab.id == body.lab:
            raise Unprocessable(f"This service has no labs of the kind {lab.kind[:40]!r}.")
    raise NotFound(f"There is no lab {body.lab!r} in quiz {body.quiz!r}.")


def refuse_before_answer(services: Services, who: Identity, quiz: str, question: str) -> None:
    """Raises Conflict if the lab of a predict question would tell a learner too much now. Instructors may run it."""
    with services.database.read() as session:
        access = read_access(session, services.content.get(who.course).library, who, (quiz, question))
    if (why_not := access.decide(quiz, question).why_no_lab) is not None:
        raise Conflict(why_not)


def record(library: Library, lab: Lab | LabConfig, body: LabBody) -> Recording:
    """Runs the lab. Raises LabRefused, and Unprocessable, for settings that the lab cannot run with."""
    pulls = [Pull(**pull.model_dump()) for pull in body.pulls]
    lab_request = LabRequest(body.controls, body.events, pulls, body.seconds)
    try:
        answer = lab_kind_of(lab).answer(lab, lab_request, library.model_xml)
    except LabError as error:
        log.warning("a lab failed", quiz=body.quiz, why=str(error))
        raise Unprocessable("The lab cannot be run with these settings.") from error
    return Recording(gzip.compress(answer.body, GZIP_LEVEL, mtime=0), answer.steps)
