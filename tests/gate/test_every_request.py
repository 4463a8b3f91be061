"""Requests made up from the OpenAPI document, well-formed and not, in every role: no 5xx, and nothing undocumented.

Schemathesis takes a second to import, and is imported only where it is used: fast tests are collected without it.
"""

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from functools import cache
from typing import TYPE_CHECKING, Any

import httpx
import pytest
import requests
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis.errors import Unsatisfiable

from grader.gate.admission import PREFIX
from support.sites import Site

if TYPE_CHECKING:
    from schemathesis import GenerationMode

BUDGET_S = 5.0
"""No more requests are made up after this time; by then every route has been asked in every role."""

CONFORMANCE = (
    *("status_code_conformance", "content_type_conformance", "response_headers_conformance"),
    "response_schema_conformance",
)

REAL_FIELDS = {"quiz": "small", "question": "q1", "user": "ann", "names": ["zoe"], "role": "student"}
"""What to put for fields of well-formed bodies, so that some requests do something."""

NOT_READY = "GET /readyz"
"""Without a worker it answers 503."""

pytestmark = pytest.mark.slow


@cache
def conformance() -> Any:
    """The checks of Schemathesis that every answer must pass."""
    from schemathesis.checks import CHECKS, load_all_checks

    load_all_checks()
    return CHECKS.get_by_names(CONFORMANCE)


@pytest.fixture
def unlimited(open_site_with: Callable[..., Site]) -> Site:
    """A server without rate limits that has a graded submission and one that waits for a review."""
    return open_site_with(rate_per_s=1e6, rate_burst=10**6, address_rate_per_s=1e6, address_rate_burst=10**6)


def open_sessions(site: Site) -> Iterator[tuple[str, requests.Session]]:
    """A client in every role, and one without a token."""
    for role in ("student", "instructor", "service"):
        session = requests.Session()
        session.headers.update(site.client(f"{role} at random", role).headers)
        session.headers.pop("accept-encoding")
        yield role, session
    yield "stranger", requests.Session()


def real_ids(site: Site) -> dict[str, str]:
    """What to put for the parameters of paths, so that they lead somewhere."""
    ann: httpx.Client = site.client("student at random")
    handed_in = ann.post(f"{PREFIX}/submissions", json={"quiz": "small", "question": "q4", "answer": "because"})
    return {"quiz_id": "small", "submission_id": handed_in.json()["id"]}


def ask(
    operation: Any,
    site: Site,
    sessions: Sequence[requests.Session],
    mode: "GenerationMode",
    ids: dict[str, str],
    n: int,
) -> set[int]:
    """Sends `n` made-up requests in each session, and checks what comes back. Returns the statuses."""
    seen: set[int] = set()
    known = {name: ids[name] for name in ids if f"{{{name}}}" in operation.path} or None

    @settings(
        max_examples=n, database=None, derandomize=True, phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )  # fmt: skip
    @given(case=operation.as_strategy(mode, path_parameters=known))
    def send(case: Any) -> None:
        if ids and isinstance(case.body, dict):
            case.body |= {name: value for name, value in REAL_FIELDS.items() if name in case.body}
        for session in sessions:
            response = case.call(base_url=site.origin, session=session, timeout=20)
            seen.add(response.status_code)
            may_be_503 = operation.label == NOT_READY and response.status_code == 503
            assert response.status_code < 500 or may_be_503, (operation.label, case.as_curl_command(), response.text)
            case.validate_response(response, checks=conformance())

    with suppress(Unsatisfiable):  # a route that takes nothing has no malformed request
        send()
    return seen


def test_no_request_breaks_the_service_or_its_description(unlimited: Site) -> None:
    import schemathesis
    from schemathesis import GenerationMode

    document = unlimited.anonymous().get("/openapi.json").json()
    results: Any = schemathesis.openapi.from_dict(document).get_all_operations()
    operations = [result.ok() for result in results]
    ids, began, seen = real_ids(unlimited), time.monotonic(), set[int]()
    roles = [session for _, session in open_sessions(unlimited)]
    rounds = [(GenerationMode.POSITIVE, ids, 2), (GenerationMode.NEGATIVE, {}, 1), (GenerationMode.POSITIVE, {}, 2),
              (GenerationMode.POSITIVE, ids, 8), (GenerationMode.NEGATIVE, ids, 8)]  # fmt: skip
    for number, (mode, known, n) in enumerate(rounds):
        for operation in operations:
            if number == 0 or time.monotonic() - began < BUDGET_S:
                seen |= ask(operation, unlimited, roles, mode, known, n)
    for session in roles:
        session.close()
    assert {200, 201, 204, 401, 403, 404, 422, 503} <= seen


def test_what_is_not_described_is_found(unlimited: Site) -> None:
    import schemathesis
    from schemathesis import GenerationMode
    from schemathesis.core.failures import FailureGroup

    document = unlimited.anonymous().get("/openapi.json").json()
    del document["paths"]["/healthz"]["get"]["responses"]["200"]
    results: Any = schemathesis.openapi.from_dict(document).include(path="/healthz").get_all_operations()
    (operation,) = (result.ok() for result in results)
    with requests.Session() as session, pytest.raises(FailureGroup, match="Undocumented status code"):
        ask(operation, unlimited, [session], GenerationMode.POSITIVE, {}, 1)
