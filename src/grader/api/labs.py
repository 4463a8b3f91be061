"""`/labs:run`: a lab is run here, and the page plays what was recorded."""

import gzip
import hashlib
import json
from typing import Annotated, Any, Self

import structlog
from fastapi import APIRouter, Header
from fastapi.responses import Response
from pydantic import BaseModel, ConfigDict, Field, StrictBool, StrictFloat, StrictInt, StrictStr, model_validator

from grader.api.context import AppContext, Context, Learner
from grader.api.problems import documented
from grader.domain.lab import IntegratorsLab, LabConfig
from grader.domain.quiz import PredictQuestion
from grader.errors import Conflict, LabError, NotFound, Unprocessable
from grader.identity import Identity
from grader.labs.lab import run_integrators, run_lab
from grader.library import Library
from grader.store import submissions
from grader.store.submissions import Chosen

router = APIRouter()
log = structlog.get_logger()

GZIP_LEVEL = 5
"""Most of the saving at a third of the time."""

Setting = StrictBool | StrictInt | StrictFloat | StrictStr


class LabBody(BaseModel):
    """Which lab, and how its controls stand; `events` are presses of buttons: time [s] and label."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)

    quiz: str = Field(max_length=64)
    question: str | None = Field(default=None, max_length=64)
    lab: str | None = Field(default=None, max_length=64)
    controls: dict[str, Setting] = Field(default_factory=dict, max_length=100)
    events: list[tuple[StrictInt | StrictFloat, StrictStr]] = Field(default_factory=list, max_length=1000)
    seconds: float | None = None

    @model_validator(mode="after")
    def _one_of_both(self) -> Self:
        if (self.question is None) == (self.lab is None):
            raise ValueError("give either a question or a lab")
        return self


class IntegratorsSettings(BaseModel):
    """What a learner may choose of a lab that compares integrators."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, strict=True)

    model: str | None = None
    key: str | None = None
    timestep: float | None = None
    seconds: float | None = None


@router.post("/labs:run", responses=documented(401, 403, 404, 409, 413, 422, 429))
def run(body: LabBody, who: Learner, context: AppContext, accept_encoding: Annotated[str, Header()] = "") -> Response:
    """Poses, readouts, traces and warnings with their time; 409 before the prediction was made."""
    library = context.content.library
    lab = find_lab(library, body)
    if body.question is not None:
        refuse_before_answer(context, who, body.quiz, body.question)
    settings = json.dumps([library.digest(body.quiz), body.model_dump()], sort_keys=True)
    digest = hashlib.sha256(settings.encode(errors="surrogatepass")).hexdigest()
    packed = context.labs.get(digest, lambda: gzip.compress(answer(library, lab, body), GZIP_LEVEL, mtime=0))
    headers = {"Vary": "Accept-Encoding"}
    if "gzip" not in accept_encoding:
        return Response(gzip.decompress(packed), media_type="application/json", headers=headers)
    return Response(packed, media_type="application/json", headers={**headers, "Content-Encoding": "gzip"})


def find_lab(library: Library, body: LabBody) -> LabConfig | IntegratorsLab:
    """The lab that is meant. Raises NotFound."""
    if body.question is not None:
        question = library.question(body.quiz, body.question)
        if isinstance(question, PredictQuestion) and question.sim is not None:
            return question.sim
        raise NotFound(f"Question {body.question!r} has no lab.")
    for lab in library.quiz(body.quiz).labs:
        if lab.id == body.lab:
            return lab
    raise NotFound(f"There is no lab {body.lab!r} in quiz {body.quiz!r}.")


def refuse_before_answer(context: Context, who: Identity, quiz: str, question: str) -> None:
    """Raises Conflict: a prediction is made before one looks. Instructors may look."""
    with context.database.read() as session:
        answered = submissions.attempts_at(session, Chosen(who.course, who.user, quiz, question))
    if not answered and not who.is_instructor:
        raise Conflict("Answer the question first: the lab opens when your prediction is made.")


def answer(library: Library, lab: LabConfig | IntegratorsLab, body: LabBody) -> bytes:
    """The run as JSON. Raises Unprocessable for settings that the lab does not offer or cannot run with."""
    try:
        shown = compare(library, lab, body) if isinstance(lab, IntegratorsLab) else simulate(library, lab, body)
    except LabError as error:
        log.warning("a lab failed", quiz=body.quiz, why=str(error))
        raise Unprocessable("The lab cannot be run with these settings.") from error
    return json.dumps(shown, allow_nan=False, separators=(",", ":")).encode()


def simulate(library: Library, lab: LabConfig, body: LabBody) -> dict[str, Any]:
    """One scene with its controls."""
    xml = lab.xml if lab.xml is not None else library.model_xml(lab.model or "")
    return run_lab(lab, xml, body.controls, body.events, body.seconds).to_json()


def compare(library: Library, lab: IntegratorsLab, body: LabBody) -> dict[str, Any]:
    """One scene under all five integrators."""
    try:
        settings = IntegratorsSettings.model_validate(body.controls)
    except ValueError as error:
        raise Unprocessable(
            "This lab takes `model`, `key` (a keyframe's name), `timestep` [s] and `seconds`."
        ) from error
    if body.events:
        raise Unprocessable("This lab has no buttons.")
    model = settings.model or lab.model
    if model not in (lab.model, *lab.models):
        raise Unprocessable(f"model must be one of: {', '.join(dict.fromkeys((lab.model, *lab.models)))}.")
    seconds = settings.seconds if settings.seconds is not None else body.seconds
    xml = library.model_xml(model)
    try:
        run = run_integrators(lab, xml, model=model, key=settings.key, timestep=settings.timestep, seconds=seconds)
    except KeyError as error:
        raise Unprocessable(str(error.args[0])) from error
    return run.to_json()
