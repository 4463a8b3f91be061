"""Learning platforms, simulated: the gradebook service of Canvas, Moodle, Open edX and Blackboard with their quirks."""

import json
import random
import secrets
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any
from urllib.parse import parse_qs, parse_qsl, urlsplit

from grader.domain.platform import Platform, ScoreTarget
from grader.platforms.sending.line_items import LINE_ITEM, READ_RESULT, SCORE
from grader.platforms.sending.score import CANVAS
from platforms.receivers import HERE, Answer, Asked, receiving


@dataclass(frozen=True)
class Profile:
    """How a platform differs from the others."""

    name: str
    taken: int = 200
    """The status of a score that was taken."""
    stale: int = 409
    """The status of a score that is not newer than the last one."""
    whole_seconds: bool = False
    """Whether timestamps are compared in whole seconds."""
    pending_clears: bool = True
    """Whether a score that is not final takes the grade away."""
    query: str = ""
    """What stands in the URLs of line items after their path."""
    filters: bool = True
    """Whether line items are filtered by `resource_id`; else they come in pages of two."""
    own_columns: bool = False
    """Whether only line items that the tool made are shown to it."""
    throttles: bool = False
    """Whether it says 403 when it is asked too much."""
    attempts_max: int | None = None
    """Submissions that a learner has, where a score counts as one unless it says otherwise."""
    digits: int = 5
    """Decimals of a grade that it keeps."""


CANVAS_LMS = Profile("canvas", stale=400, throttles=True, attempts_max=1, filters=False)
MOODLE = Profile("moodle", whole_seconds=True, query="?type_id=2")
OPEN_EDX = Profile("openedx", taken=201, stale=400, pending_clears=False, digits=2)
BLACKBOARD = Profile("blackboard", own_columns=True, query="?x=1&y=a%20b", filters=False)
PROFILES = (CANVAS_LMS, MOODLE, OPEN_EDX, BLACKBOARD)


@dataclass
class Grade:
    """What a gradebook has for a learner."""

    given: float | None = None
    maximum: float = 1.0
    timestamp: datetime = datetime(1970, 1, 1, tzinfo=UTC)


@dataclass
class Simulated:
    """One platform on loopback. `taken` are the scores that it took, in order; `requests` counts by kind."""

    profile: Profile
    fault_rate: float = 0.0
    seed: int = 0
    origin: str = ""
    client_id: str = "client-1"
    items: dict[str, dict[str, Any]] = field(default_factory=dict)
    grades: dict[tuple[str, str], Grade] = field(default_factory=dict)
    taken: list[dict[str, Any]] = field(default_factory=list)
    attempts: dict[str, int] = field(default_factory=dict)
    tokens: set[str] = field(default_factory=set)
    token_requests: list[dict[str, str]] = field(default_factory=list)
    requests: list[str] = field(default_factory=list)
    faults: list[str] = field(default_factory=list)
    fault: Callable[[Asked], str | None] | None = None
    override: Callable[[Asked], Answer | None] | None = None
    """What is answered in place of the platform."""
    _lock: threading.Lock = field(default_factory=threading.Lock)
    _draw: random.Random = field(init=False)

    def __post_init__(self) -> None:
        self._draw = random.Random(self.seed)

    @property
    def platform(self) -> Platform:
        return Platform(
            1, "https://platform.example", self.client_id, f"{self.origin}/login", f"{self.origin}/token", ""
        )

    @property
    def container(self) -> str:
        """The line items service of the course."""
        return f"{self.origin}/context/1/lineitems{self.profile.query}"

    def enter(self, item: str, user: str, given: float, maximum: float) -> None:
        """A person enters a grade."""
        with self._lock:
            self.grades[item, user] = Grade(given, maximum, datetime.now(UTC))

    def take(self, asked: Asked) -> Answer:
        """What a request comes to that arrives now, whenever it was sent."""
        return self._answer(asked)

    def respond(self, asked: Asked) -> Answer:
        if self.override is not None and (answer := self.override(asked)) is not None:
            return answer
        with self._lock:
            fault = self._fault(asked)
            if fault is not None:
                self.faults.append(fault)
            if fault == "lost before":
                return Answer(drops=True)
            if fault in ("500", "503", "429"):
                return Answer(int(fault), b"busy", {"Retry-After": "0"})
            if fault == "403":
                return Answer(403, b"403 Forbidden (Rate Limit Exceeded)\n")
            if fault == "401":
                self.tokens.clear()
            answer = self._answer(asked)
            return Answer(drops=True) if fault == "lost after" else answer

    def _fault(self, asked: Asked) -> str | None:
        if self.fault is not None:
            return self.fault(asked)
        if self._draw.random() >= self.fault_rate:
            return None
        kinds = ["lost before", "lost after", "500", "503", "429", "401"]
        return self._draw.choice([*kinds, *(["403"] * 3 if self.profile.throttles else [])])

    def _answer(self, asked: Asked) -> Answer:
        parts = urlsplit(asked.path)
        if parts.path == "/token":
            return self._token(asked)
        if asked.headers.get("authorization", "").removeprefix("Bearer ") not in self.tokens:
            self.requests.append("unauthorized")
            return Answer(401)
        if dict(parse_qsl(self.profile.query[1:])).items() - dict(parse_qsl(parts.query)).items():
            return Answer(404, b"the query string is missing")
        tail = parts.path.removeprefix("/context/1/lineitems").strip("/").split("/")
        self.requests.append(f"{asked.method} {tail[-1] if len(tail) > 1 else 'lineitems'}")
        if tail == [""]:
            return self._created(asked) if asked.method == "POST" else self._listed(parse_qs(parts.query))
        if tail[0] not in self.items:
            return Answer(404, b"no such line item")
        return self._scored(asked, tail[0]) if tail[1] == "scores" else self._result(tail[0], parse_qs(parts.query))

    def _token(self, asked: Asked) -> Answer:
        form = dict(parse_qsl(asked.body.decode()))
        self.token_requests.append(form)
        claims = json.loads(form["client_assertion"])
        assert claims["iss"] == claims["sub"] == self.client_id
        assert claims["aud"] == f"{self.origin}/token"
        assert 0 < claims["exp"] - claims["iat"] <= 300
        token = secrets.token_hex(8)
        self.tokens.add(token)
        return Answer.of({"access_token": token, "token_type": "Bearer", "expires_in": 3600, "scope": form["scope"]})

    def url_of(self, item: str) -> str:
        return f"{self.origin}/context/1/lineitems/{item}{self.profile.query}"

    def _shown(self) -> list[dict[str, Any]]:
        return [
            {"id": self.url_of(key), **item}
            for key, item in self.items.items()
            if item.get("byTool") or not self.profile.own_columns
        ]

    def _listed(self, query: dict[str, list[str]]) -> Answer:
        items = self._shown()
        if self.profile.filters:
            wanted = query.get("resource_id", [""])[0]
            return Answer.of([item for item in items if item.get("resourceId") == wanted])
        start = int(query.get("page", ["0"])[0])
        headers = {}
        if start + 2 < len(items):
            joint = "&" if self.profile.query else "?"
            following = f"{self.container}{joint}page={start + 2}"
            headers["Link"] = f'<{self.container}>; rel="first", <{following}>; rel="next"'
        return Answer.of(items[start : start + 2], 200, **headers)

    def _created(self, asked: Asked) -> Answer:
        key = f"item{len(self.items)}"
        self.items[key] = asked.json() | {"byTool": True}
        return Answer.of({"id": self.url_of(key), **self.items[key]}, 201)

    def _result(self, item: str, query: dict[str, list[str]]) -> Answer:
        user = query["user_id"][0]
        grade = self.grades.get((item, user))
        if grade is None:
            return Answer.of([])
        shown: dict[str, Any] = {"id": f"{self.url_of(item)}/{user}", "userId": user, "resultMaximum": 100}
        if grade.given is not None:
            shown["resultScore"] = round(grade.given / grade.maximum * 100, self.profile.digits)
        return Answer.of([shown])

    def _scored(self, asked: Asked, item: str) -> Answer:
        score = asked.json()
        user, timestamp = score["userId"], datetime.fromisoformat(score["timestamp"])
        grade = self.grades.setdefault((item, user), Grade())
        old, new = grade.timestamp, timestamp
        if self.profile.whole_seconds:
            old, new = old.replace(microsecond=0), new.replace(microsecond=0)
        if new <= old:
            return Answer(self.profile.stale, b"the score is older than the last one")
        if self.profile.attempts_max is not None and score.get(CANVAS, {}).get("new_submission", True):
            self.attempts[user] = self.attempts.get(user, 0) + 1
            if self.attempts[user] > self.profile.attempts_max:
                return Answer(422, b"no attempt is left")
        self.taken.append(score | {"item": item})
        grade.timestamp = timestamp
        if score["gradingProgress"] == "FullyGraded":
            grade.given, grade.maximum = score["scoreGiven"], score["scoreMaximum"]
        elif self.profile.pending_clears:
            grade.given = None
        return Answer(self.profile.taken)


SCOPES = (LINE_ITEM, READ_RESULT, SCORE)


def place(
    platform: Platform, line_items_url: str | None, learner: str, resource_id: str, scopes: tuple[str, ...] = SCOPES
) -> ScoreTarget:
    """Where a learner's score goes on a simulated platform."""
    return ScoreTarget(platform, "", line_items_url or "", scopes, learner, "1", "", resource_id)


@contextmanager
def simulated(profile: Profile, **options: Any) -> Iterator[Simulated]:
    """A platform that serves."""
    platform = Simulated(profile, **options)
    with receiving(platform.respond) as port:
        platform.origin = f"http://{HERE}:{port}"
        yield platform
