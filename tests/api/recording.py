"""Records what a server answers as examples, with everything replaced that differs from run to run."""

import json
import re
from collections.abc import Iterator, Mapping
from operator import itemgetter
from typing import Any

import httpx

from grader.gate.admission import PREFIX

AT = "2026-10-05T09:30:00Z"
TIME = re.compile(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(\.\d+)?(Z|\+00:00)")
CREDENTIAL = re.compile(r"\b(gr[a-z])_([0-9a-f]{16})_[\w-]{20,}")
SECRET = re.compile(r"\bwhsec_[\w+/=-]+")
CODE = re.compile(r"([?&](?:code|token)=)[\w-]{20,}")
USER_CODE = re.compile(r"\b[B-Z]{4}-[B-Z]{4}\b")
PSEUDONYM = re.compile(r"\blearner-[a-z0-9]{8}\b")
CLIENT = re.compile(r"\bclient-[0-9a-f]{8}\b")
HEX = re.compile(r"\b(?:[0-9a-f]{64}|[0-9a-f]{32}|[0-9a-f]{16})\b")

ENVIRONMENT = {"mujoco": "3.14.0", "numpy": "2.4.6", "python": "3.12.3", "machine": "Linux x86_64"}
JAIL = {"ok": True, "tier": "T1", "self_test": "passed", "integrators": "removable", "workers": 1}
CODES = {"device_code": "KU2VCraiIDY...", "user_code": "BCDF-GHJK"}
CONSTANTS: dict[str, Any] = {
    "environment": ENVIRONMENT, "jail": JAIL, "seed": 7, "next_cursor": "YXQ6MDFhMWZmMzVlMDdm", **CODES,
}  # fmt: skip
"""What stands for the values of these keys, unless they are null or empty."""

ITEMS_MAX = 3
"""Longer lists are cut, such as the frames of a lab."""

FIGURES = 6
"""Significant figures of numbers."""

SHOWN_METRIC = "grader_queue_jobs"
ZIP = "PK..."
"""What stands for a file."""


class Normaliser:
    """Replaces ids, times, secrets and origins by stable values. Ids are numbered anew in each response."""

    def __init__(self, origins: Mapping[str, str], times: tuple[str, ...] = ()) -> None:
        self._origins, self._times = origins, times
        self._numbers: dict[str, int] = {}

    def response(self, value: Any) -> Any:
        """Normalises the content of a response."""
        self._numbers.clear()
        return self.value(value)

    def value(self, value: Any, key: str = "") -> Any:
        """Normalises a value of JSON that stands under a key."""
        if value and key in CONSTANTS:
            return CONSTANTS[key]
        if key == "timing_ms":
            return dict.fromkeys(value, 1.0)
        if isinstance(value, dict):
            return {self.text(name): self.value(part, name) for name, part in value.items()}
        if isinstance(value, list):
            if value and isinstance(value[0], dict) and "way_in" in value[0]:  # members, who are listed by their ids
                value = sorted(value, key=itemgetter("name"))
            return [self.value(part, key) for part in value[:ITEMS_MAX]]
        if isinstance(value, float):
            return float(f"{value:.{FIGURES}g}")
        return self.text(value) if isinstance(value, str) else value

    def text(self, text: str) -> str:
        """Normalises a text."""
        for origin, stable in self._origins.items():
            text = text.replace(origin, stable)
        text = TIME.sub(lambda match: match[0] if match[0] in self._times else AT, text)
        text = CREDENTIAL.sub(lambda match: f"{match[1]}_{self._number(match[2]):016x}_...", text)
        text = SECRET.sub("whsec_c2hvd24gb25jZSwgYW5kIHNvIG5vdCBoZXJlIQ==", text)
        text = CODE.sub(r"\1KU2VCraiIDY...", text)
        text = USER_CODE.sub(CODES["user_code"], text)
        text = PSEUDONYM.sub(lambda match: f"learner-{self._number(match[0]):08d}", text)
        text = CLIENT.sub("client-1", text)
        return HEX.sub(lambda match: f"{self._number(match[0]):0{len(match[0])}x}", text)

    def _number(self, text: str) -> int:
        return self._numbers.setdefault(text, len(self._numbers) + 1)


class Recorder:
    """Sends requests, and records the responses by route and status; of problems, one by status."""

    def __init__(self, normaliser: Normaliser) -> None:
        self._normaliser = normaliser
        self.responses: dict[str, dict[str, Any]] = {}
        self.problems: dict[str, Any] = {}

    def record(self, status: int, client: httpx.Client, route: str, **request: Any) -> httpx.Response:
        """Sends a request to a route such as `GET /quizzes/{quiz_id}`, which must be answered with this status.

        Those of `request` that the route names are its parameters; all others are httpx's.
        """
        method, template = route.split(" ")
        path = template.format(**request)
        options = {name: value for name, value in request.items() if f"{{{name}}}" not in template}
        response = client.request(method, path if path in OUTSIDE else f"{PREFIX}{path}", **options)
        assert response.status_code == status, f"{route}: {response.status_code} {response.text}"
        if status < 400:
            self.responses.setdefault(route, {})[str(status)] = self._content(response)
        elif path in OUTSIDE:  # what readiness says is its own
            self.responses.setdefault(route, {})[str(status)] = self._problem(response)
        else:
            self.problems[str(status)] = self._problem(response)
        return response

    def document(self) -> dict[str, Any]:
        """The examples as they are shipped."""
        return {
            "problems": dict(sorted(self.problems.items())),
            "responses": {route: dict(sorted(by.items())) for route, by in sorted(self.responses.items())},
        }

    def _problem(self, response: httpx.Response) -> Any:
        """The members of a problem that are not the same in every one of its status."""
        members = response.json().items()
        own = {name: value for name, value in members if name not in ("type", "title", "status", "request_id")}
        return self._normaliser.response(own)

    def _content(self, response: httpx.Response) -> Any:
        media_type = response.headers["content-type"].partition(";")[0]
        if media_type == "application/json":
            return self._normaliser.response(response.json())
        if media_type == "application/zip":
            return ZIP
        if media_type == "text/event-stream":
            return self._normaliser.response(dict(first_event(response.text)))
        lines = response.text.splitlines(keepends=True)
        shown = [line for line in lines if SHOWN_METRIC in line] if media_type == "text/plain" else lines
        return self._normaliser.response("".join(shown))


OUTSIDE = ("/healthz", "/readyz", "/metrics")


def first_event(text: str) -> Iterator[tuple[str, str]]:
    """The fields of the first event of a stream."""
    for line in text.split("\n\n", maxsplit=1)[0].splitlines():
        if not line.startswith(":"):
            name, _, value = line.partition(": ")
            yield name, value


def as_text(document: Mapping[str, Any]) -> str:
    """The examples as the text of their file."""
    return json.dumps(document, indent=1, ensure_ascii=False) + "\n"
