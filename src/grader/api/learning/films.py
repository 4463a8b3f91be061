"""`/submissions/{id}/films`: the judge's runs behind a verdict, as moving pictures."""

import gzip
import hashlib
import json
from collections.abc import Callable, Mapping
from functools import partial
from typing import Annotated, Any

from fastapi import Header, Query
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import Response

from grader.api.learning.labs import GZIP_LEVEL, respond
from grader.api.learning.submissions import find_visible, read_seen
from grader.courses.answering.access import read_access
from grader.courses.people.identity import Identity
from grader.courses.rules.policy import redact_json
from grader.errors import ContentLost
from grader.gate.callers import Learner, api_router
from grader.gate.lab_runs import Recording
from grader.gate.problems import refusals
from grader.gate.services import AppServices, Services
from grader.grading.content import Archive
from grader.grading.films import record_films
from grader.store.tables import Submission

router = api_router("submissions")


@router.get(
    "/submissions/{submission_id}/films",
    responses=refusals(401, 403, 404, 422, 429, more={200: {"model": dict[str, Any]}}),
)
async def show_films(
    submission_id: str, who: Learner, services: AppServices,
    timestep_ms: Annotated[float | None, Query(gt=0, le=1000, allow_inf_nan=False)] = None,
    accept_encoding: Annotated[str, Header()] = "",
) -> Response:  # fmt: skip
    """Shows runs of the judge behind a verdict side by side, as far as the reader may see what they tell.

    Each of `films` has the poses of its `panels` by time. There are none for an answer without a verdict, and for one
    whose verdict shows no run. With `timestep_ms` the runs at this timestep alone, where the solution is shown."""
    digest, make = await run_in_threadpool(prepare, services, who, submission_id, timestep_ms)
    packed = await services.labs.get((who.course, who.id), digest, make)
    return await respond(packed, accept_encoding)


def prepare(
    services: Services, who: Identity, submission_id: str, timestep_ms: float | None
) -> tuple[str, Callable[[], Recording]]:
    """Returns the digest of the films of a submission, and the call that makes them. Raises NotFound."""
    with services.database.read() as session:
        submission = find_visible(session, submission_id, who)
        verdict = read_seen(session, services, who, [submission]).verdicts.get(submission.id)
        at = submission.quiz, submission.question
        decision = read_access(session, services.content.get(who.course).library, who, at).decide(*at)
    shown = redact_json(verdict, decision) or {}
    judged = {name: shown.get(name) for name in ("evidence", "findings", "content_digest")}
    settings = json.dumps(["films", submission.id, submission.seed, timestep_ms, judged], sort_keys=True)
    digest = hashlib.sha256(settings.encode(errors="surrogatepass")).hexdigest()
    return digest, partial(record, services.content.archive, submission, shown, timestep_ms)


def record(
    archive: Archive, submission: Submission, verdict: Mapping[str, Any], timestep_ms: float | None
) -> Recording:
    """Makes the films of a verdict, or the one at a timestep [ms], by the content that it was made with."""
    films = []
    if verdict.get("content_digest") and submission.seed is not None:
        try:
            library = archive.get_pipeline(submission.quiz, verdict["content_digest"]).library
            at = submission.quiz, submission.question
            timestep_s = None if timestep_ms is None else timestep_ms / 1000
            films = record_films(library, at, submission.seed, verdict, timestep_s)
        except ContentLost:
            pass  # what it was graded with can no longer be loaded
    plain = json.dumps({"films": [film.to_json() for film in films]}, allow_nan=False, separators=(",", ":"))
    steps = sum(film.steps for film in films)
    return Recording(gzip.compress(plain.encode(), GZIP_LEVEL, mtime=0), steps)
