"""Requests of the client: refusals as sentences, waiting for a busy server, the sign-in with a code, and the token."""

import json
import os
import stat
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from mjgrader import devices, outbox
from mjgrader.accounts import Account, load_account, read_site, save_account
from mjgrader.command import write_commands
from mjgrader.connection import Connection
from mjgrader.errors import Offline, Refusal, Sentence, SignInAgain
from mjgrader.kits import Kit
from mjgrader.session import Session
from mjgrader.showing import Answer

SITE = "https://grader.example.edu"
TOKEN = "grt_0123456789abcdef_very-secret-part-of-it"
PROBLEM = {"Content-Type": "application/problem+json"}
Handler = Callable[[httpx.Request], httpx.Response]


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("MJGRADER_CONFIG", str(tmp_path / "config"))
    return tmp_path / "config"


@pytest.fixture
def slept(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    pauses: list[float] = []
    monkeypatch.setattr(time, "sleep", pauses.append)
    return pauses


def connect(handler: Handler, said: list[str] | None = None) -> Connection:
    say = (said if said is not None else []).append
    return Connection(Account(SITE, TOKEN), say, httpx.MockTransport(handler))


def refuse(status: int, detail: str = "The reason.", **headers: str) -> Handler:
    return lambda request: httpx.Response(status, json={"detail": detail}, headers={**PROBLEM, **headers})


@pytest.mark.parametrize(
    ("status", "error", "says"),
    [
        (401, SignInAgain, "sign in again"),
        (403, Refusal, "does not allow this: The reason."),
        (404, Refusal, "The reason."),
        (409, Refusal, "The reason."),
        (413, Refusal, "The reason."),
        (422, Refusal, "The reason."),
        (500, Offline, "try again later"),
    ],
)
def test_a_refusal_is_one_sentence_that_says_what_to_do(status: int, error: type[Sentence], says: str) -> None:
    with pytest.raises(error, match=says) as raised:
        connect(refuse(status)).get("/quizzes")
    assert TOKEN not in str(raised.value)


def test_a_busy_server_is_waited_for_as_long_as_it_asks(slept: list[float]) -> None:
    answers = iter(
        [httpx.Response(429, headers={"Retry-After": "7"}), httpx.Response(503), httpx.Response(200, json=[1])]
    )
    said: list[str] = []
    assert connect(lambda request: next(answers), said).get("/quizzes") == [1]
    assert slept == [7.0, 5.0]
    assert said == ["The server is busy: waiting 7 s.", "The server is busy: waiting 5 s."]


def test_a_server_that_stays_busy_is_not_waited_for_without_end(slept: list[float]) -> None:
    with pytest.raises(Offline, match="try again in 50 s"):
        connect(refuse(429, **{"Retry-After": "50"})).get("/quizzes")
    assert slept == [50.0, 50.0]


def test_a_redirection_does_not_get_the_token() -> None:
    asked: list[httpx.Request] = []

    def answer(request: httpx.Request) -> httpx.Response:
        asked.append(request)
        return httpx.Response(301, headers={"Location": "https://elsewhere.example/"})

    with pytest.raises(Refusal, match=r"elsewhere\.example"):
        connect(answer).get("/quizzes")
    assert [request.url.host for request in asked] == ["grader.example.edu"]


@pytest.mark.parametrize("text", ["<html>", "[1"])
def test_another_web_page_is_told(text: str) -> None:
    with pytest.raises(Sentence, match="check the address"):
        connect(lambda request: httpx.Response(200, text=text)).get("/quizzes")
    with pytest.raises(Refusal, match="no course server"):
        connect(lambda request: httpx.Response(404, text=text)).get("/quizzes")


def test_a_token_is_not_sent_readably() -> None:
    with pytest.raises(Sentence, match=r"write https://grader\.example\.edu"):
        read_site("http://grader.example.edu")
    assert read_site("http://grader.example.edu", insecure=True) == "http://grader.example.edu"
    assert read_site("grader.example.edu/quizzes/x") == "https://grader.example.edu"
    assert read_site("http://127.0.0.1:8000/") == "http://127.0.0.1:8000"
    assert read_site("127.0.0.1:8731") == "http://127.0.0.1:8731"
    for wrong in ("", "ftp://x", "https://"):
        with pytest.raises(Sentence, match="no address"):
            read_site(wrong)


@pytest.mark.skipif(os.name == "nt", reason="Windows has no modes of files")
def test_the_token_is_kept_readable_by_its_owner_alone_and_never_printed(folder: Path) -> None:
    account = Account(SITE, TOKEN, "robots")
    assert TOKEN not in repr(account)
    path = save_account(account)
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert stat.S_IMODE(path.parent.stat().st_mode) == 0o700
    assert load_account() == account
    path.chmod(0o644)
    save_account(account)
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    said: list[str] = []
    session = Session(said.append, httpx.MockTransport(lambda request: httpx.Response(200, json={"items": []})))
    session.sign_in(SITE, TOKEN)
    assert said
    assert TOKEN not in repr(session) + "".join(said)
    session.sign_out()
    with pytest.raises(SignInAgain, match=r"Sign in first: g\.sign_in"):
        load_account()


def test_an_empty_token_is_told() -> None:
    with pytest.raises(Sentence, match="The token is empty"):
        Session(lambda text: None).sign_in(SITE, " \n")


def test_a_sign_in_says_as_whom_and_names_the_exercises(slept: list[float]) -> None:
    made = {"access_token": TOKEN, "course": "robots", "user": "ada"}
    device, _ = device_server((200, made))
    quiz = {"id": "q", "questions": [{"id": "rk4-step", "kind": "code"}, {"id": "q1", "kind": "number"}]}

    def answer(request: httpx.Request) -> httpx.Response:
        if request.url.path.startswith("/api/v1/quizzes"):
            return httpx.Response(200, json=quiz if request.url.path.endswith("/q") else {"items": [{"id": "q"}]})
        return httpx.Response(200, json={"items": []}) if request.method == "GET" else device(request)

    said: list[str] = []
    session = Session(said.append, httpx.MockTransport(answer))
    session.sign_in(SITE)
    assert said[-1].startswith(f"Signed in as ada at {SITE}: 1 quiz, exercises: rk4-step. Your token")
    with pytest.raises(Sentence, match=r"There is no exercise 'rk5'\. The course has: rk4-step\."):
        session.result("rk5")
    with pytest.raises(Sentence, match="handed in nothing yet"):
        session.result("rk4-step")


def test_a_token_that_the_server_never_knew_is_to_be_copied_again(folder: Path) -> None:
    session = Session(lambda text: None, httpx.MockTransport(refuse(401)))
    with pytest.raises(SignInAgain) as raised:
        session.sign_in(SITE, "wrong")
    assert str(raised.value) == f"{SITE} does not know this token: copy it again, or ask for a new one."
    assert not (folder / "account.json").exists()


@pytest.mark.parametrize(("status", "whom"), [(200, " as ada"), (404, "")])
def test_a_token_that_was_typed_says_whose_it_is(status: int, whom: str) -> None:
    def answer(request: httpx.Request) -> httpx.Response:
        if request.url.path.endswith("/me"):  # which older servers have not
            return httpx.Response(status, json={"user": "ada", "course": "robots", "detail": "No."}, headers=PROBLEM)
        return httpx.Response(200, json={"items": []})

    said: list[str] = []
    Session(said.append, httpx.MockTransport(answer)).sign_in(SITE, TOKEN)
    assert said[-1].startswith(f"Signed in{whom} at {SITE}: 0 quizzes")
    assert load_account().user == ("ada" if whom else None)


def test_waiting_that_is_stopped_loses_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    def stop(_seconds: float) -> None:
        raise KeyboardInterrupt

    waiting = {"id": "s1", "quiz": "q", "question": "rk4-step", "status": "running", "attempt": 1, "verdict": None}
    verdict = {"status": "correct", "points": 1.0, "max_points": 1.0, "findings": [], "evidence": {}}
    stored = {"s1": {**waiting, "status": "graded", "verdict": verdict}, "q": {"questions": []}}
    server = httpx.MockTransport(lambda request: httpx.Response(200, json=stored[request.url.path.rpartition("/")[2]]))
    said: list[str] = []
    session = Session(said.append, server, Account(SITE, TOKEN))
    session.last = Answer(waiting, SITE)
    with monkeypatch.context() as patched:
        patched.setattr(time, "sleep", stop)
        assert session.wait(session.last).status == "running"
    assert said[-1].startswith("Stopped waiting. It is handed in, and graded all the same: g.result()")
    assert session.result().status == "correct"


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """The time that sleeping alone takes, in its one item."""
    now = [0.0]

    def sleep(seconds: float) -> None:
        now[0] += seconds

    monkeypatch.setattr(time, "sleep", sleep)
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    return now


@pytest.mark.parametrize("away_s", [20.0, 1e9])
def test_waiting_outlasts_a_restart_of_the_server_and_says_what_is_handed_in(away_s: float, clock: list[float]) -> None:
    waiting = {"id": "s1", "quiz": "q", "question": "rk4-step", "status": "running", "attempt": 1, "verdict": None}
    verdict = {"status": "correct", "points": 1.0, "max_points": 1.0, "findings": [], "evidence": {}}
    stored = {"s1": {**waiting, "status": "graded", "verdict": verdict}, "q": {"questions": []}}

    def answer(request: httpx.Request) -> httpx.Response:
        if clock[0] < away_s:
            raise httpx.ConnectError("refused")
        return httpx.Response(200, json=stored[request.url.path.rpartition("/")[2]])

    said: list[str] = []
    session = Session(said.append, httpx.MockTransport(answer), Account(SITE, TOKEN))
    status = session.wait(Answer(waiting, SITE)).status
    assert said[:2] == ["Running.", "The server does not answer: waiting for it."]
    if away_s < 60:
        assert (status, said[2:]) == ("correct", [])
        return
    assert (status, 60 <= clock[0] < 65) == ("running", True)
    [told] = said[2:]
    assert told.startswith(f"{SITE} cannot be reached (ConnectError)")
    assert told.endswith("It is handed in, and graded all the same: g.result() shows the verdict.")


def test_a_verdict_is_shown_though_the_server_goes_away_after_it() -> None:
    verdict = {"status": "correct", "points": 1.0, "max_points": 1.0, "findings": [], "evidence": {}}
    graded = {"id": "s1", "quiz": "q", "question": "e", "status": "graded", "attempt": 1, "verdict": verdict}

    def answer(request: httpx.Request) -> httpx.Response:
        raise httpx.ConnectError("refused")

    session = Session(lambda text: None, httpx.MockTransport(answer), Account(SITE, TOKEN))
    assert session.wait(Answer(graded, SITE)).status == "correct"


def test_sending_that_is_stopped_keeps_the_answer_under_its_key() -> None:
    def stop(_request: httpx.Request) -> httpx.Response:
        raise KeyboardInterrupt

    connection = connect(stop)
    waiting = outbox.keep(connection, "q", "rk4-step", "x = 1")
    with pytest.raises(Offline, match=r"Stopped while your answer to rk4-step was sent.*g\.sync\(\) sends it"):
        outbox.deliver(connection, waiting)
    assert outbox.keep(connection, "q", "rk4-step", "x = 1").key == waiting.key


def test_a_sign_in_that_is_stopped_is_one_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    def stop(seconds: float) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(time, "sleep", stop)
    with pytest.raises(Sentence, match="The sign-in was stopped"):
        Session(lambda text: None, httpx.MockTransport(device_server()[0])).sign_in(SITE)


@pytest.mark.parametrize(("text", "command"), [
    ('call g.sign_in("https://x.edu", token=getpass.getpass()).', "call mjgrade sign-in https://x.edu --token."),
    ("g.sync() sends it", "mjgrade sync sends it"),
    ('get it with g.start("rk4-step").', "get it with mjgrade start rk4-step."),
    ('name one with question="rk4-step".', "name one with --question rk4-step."),
    ("add insecure=True; with anyway=True", "add --insecure; with --anyway"),
])  # fmt: skip
def test_a_terminal_speaks_in_commands(text: str, command: str) -> None:
    assert write_commands(text) == command


def test_a_token_can_stay_in_memory(folder: Path) -> None:
    session = Session(lambda text: None, httpx.MockTransport(lambda request: httpx.Response(200, json={"items": []})))
    session.sign_in(SITE, TOKEN, remember=False)
    assert session.connect().account.token == TOKEN
    assert not list(folder.rglob("*"))


CODES = {
    "device_code": "d", "user_code": "WDJB-MJHT", "verification_uri": f"{SITE}/devices",
    "verification_uri_complete": f"{SITE}/devices?code=WDJB-MJHT", "interval": 5, "expires_in": 600,
}  # fmt: skip


def device_server(*answers: tuple[int, Any]) -> tuple[Handler, list[httpx.Request]]:
    """The server's side of RFC 8628 at the boundary of HTTP."""
    asked: list[httpx.Request] = []
    waiting: Iterator[tuple[int, Any]] = iter(answers)

    def answer(request: httpx.Request) -> httpx.Response:
        asked.append(request)
        if request.url.path == "/api/v1/devices":
            return httpx.Response(200, json=CODES)
        if request.url.path == "/api/v1/quizzes":
            return httpx.Response(200, json={"items": []})
        status, body = next(waiting)
        return httpx.Response(status, json=body, headers=PROBLEM if status >= 400 else {})

    return answer, asked


def test_a_code_is_confirmed_in_the_browser(slept: list[float]) -> None:
    made = {"access_token": TOKEN, "expires_in": 2592000, "scope": "answer read", "course": "robots", "user": "ada"}
    pending = (400, {"error": "authorization_pending"})
    answer, asked = device_server(pending, (400, {"error": "slow_down"}), pending, (200, made))
    said: list[str] = []
    Session(said.append, httpx.MockTransport(answer)).sign_in(SITE)
    assert said[0] == f"Open {SITE}/devices?code=WDJB-MJHT and confirm the code WDJB-MJHT"
    assert slept == [5, 5, 10, 10]
    assert all("authorization" not in request.headers for request in asked[:-1])
    assert (load_account().token, load_account().course) == (TOKEN, "robots")
    assert TOKEN not in "".join(said)


@pytest.mark.parametrize(("code", "says"), [("expired_token", "sign in again"), ("access_denied", "was refused")])
def test_a_code_that_is_refused_makes_no_token(code: str, says: str, slept: list[float], folder: Path) -> None:
    answer, _ = device_server((400, {"error": code}))
    with pytest.raises(Sentence, match=says):
        Session(lambda text: None, httpx.MockTransport(answer)).sign_in(SITE)
    assert not (folder / "account.json").exists()


def test_a_code_is_not_asked_for_longer_than_it_lasts(slept: list[float]) -> None:
    answer, asked = device_server(*[(400, {"error": "authorization_pending"})] * 200)
    with pytest.raises(Sentence, match="has expired"):
        Session(lambda text: None, httpx.MockTransport(answer)).sign_in(SITE)
    assert len(asked) == 1 + 120


def test_a_server_without_codes_is_told() -> None:
    with pytest.raises(Refusal, match="ask your instructor for a token"):
        devices.ask_for_code(SITE, httpx.MockTransport(refuse(404)))


class Server:
    """Takes answers as the service does: a key makes one submission. `cut` loses responses after that."""

    def __init__(self) -> None:
        self.made: dict[str, str] = {}
        self.cut = False
        self.away = False

    def answer(self, request: httpx.Request) -> httpx.Response:
        if self.away:
            raise httpx.ConnectError("no route")
        key = request.headers["Idempotency-Key"]
        first = self.made.setdefault(key, request.content.decode())
        assert first == request.content.decode()
        if self.cut:
            raise httpx.ReadTimeout("lost")
        return httpx.Response(202, json={"id": key, "status": "queued", "attempt": 1, "quiz": "q", "question": "e"})


def test_an_answer_is_kept_without_a_connection_and_taken_once() -> None:
    server, said = Server(), list[str]()
    connection = connect(server.answer, said)
    server.away = True
    first = outbox.keep(connection, "q", "e", "x = 1\n")
    with pytest.raises(Offline, match=r"kept here.*g\.sync\(\).*never taken twice"):
        outbox.deliver(connection, first)
    server.away, server.cut = False, True
    assert outbox.keep(connection, "q", "e", "x = 1\n") == first  # the same answer again
    with pytest.raises(Offline):
        outbox.deliver(connection, first)
    server.cut = False
    sent = outbox.deliver_all(connection)
    assert [submission["id"] for _, submission in sent] == [first.key]
    assert len(server.made) == 1
    assert not list(outbox.list_waiting(SITE))
    assert outbox.keep(connection, "q", "e", "x = 1\n").key != first.key  # a new attempt


def test_a_kept_answer_that_another_one_takes_along_is_told(tmp_path: Path) -> None:
    server = Server()
    session, said = sign_in_as(server, "ada", "robots", TOKEN)
    kept = outbox.keep(session.connect(), "q", "swing", "x = 1\n")
    tower = Kit(tmp_path, {"question": "tower", "quiz": "q", "takes": "mjcf"})
    session.submit("<mujoco/>", tower, wait=False)
    assert said == ["Your kept answer to swing was sent."]
    assert next(iter(server.made)) == kept.key and len(server.made) == 2


def sign_in_as(server: Server, user: str | None, course: str | None, token: str) -> tuple[Session, list[str]]:
    said: list[str] = []
    account = Account(SITE, token, course, user)
    return Session(said.append, httpx.MockTransport(server.answer), account), said


@pytest.mark.parametrize(("user", "course"), [("bob", "robots"), ("ada", "walking"), (None, None)])
def test_a_kept_answer_is_sent_by_its_owner_alone(user: str | None, course: str | None) -> None:
    server = Server()
    ada, _ = sign_in_as(server, "ada", "robots", TOKEN)
    kept = outbox.keep(ada.connect(), "q", "e", "x = 1\n")
    other, said = sign_in_as(server, user, course, "grt_fedcba9876543210_another")
    assert other.sync() == []
    assert outbox.keep(other.connect(), "q", "e", "x = 1\n").key != kept.key
    assert said == [
        "An answer of ada in the course robots to e waits here: it is sent once ada signs in.",
        "Nothing of yours waits to be sent.",
    ]
    assert server.made == {}
    again, _ = sign_in_as(server, "ada", "robots", "grt_00000000000000ff_renewed")
    assert [answer.id for answer in again.sync()] == [kept.key]


def test_a_kept_answer_whose_owner_is_not_known_is_sent_with_its_own_token_alone() -> None:
    server = Server()
    mine, _ = sign_in_as(server, None, None, TOKEN)
    kept = outbox.keep(mine.connect(), "q", "e", "x = 1\n")
    stored = json.loads(kept.path.read_text())
    kept.path.write_text(json.dumps({name: stored[name] for name in stored if name not in ("user", "course")}))
    for user in ("bob", None):
        other, said = sign_in_as(server, user, user, "grt_fedcba9876543210_another")
        assert other.sync() == []
        assert "nobody knows whose it is: it is not sent. If it is yours, take its text from" in said[0]
        assert str(kept.path) in said[0]
    assert [answer.id for answer in mine.sync()] == [kept.key]


def test_a_sign_in_says_whose_answers_wait() -> None:
    def answer(request: httpx.Request) -> httpx.Response:
        me: dict[str, Any] = {"user": "ada", "course": "robots"} if request.url.path.endswith("/me") else {"items": []}
        return httpx.Response(200, json=me)

    for user in ("ada", "bob"):
        outbox.keep(Connection(Account(SITE, "grt_0_old", "robots", user)), "q", "e", f"{user} = 1\n")
    said: list[str] = []
    Session(said.append, httpx.MockTransport(answer)).sign_in(SITE, TOKEN)
    assert said[1:] == [
        "Answers of yours wait to be sent: g.sync() sends them.",
        "An answer of bob in the course robots to e waits here: it is sent once bob signs in.",
    ]


def test_a_refused_answer_is_forgotten_and_one_without_a_token_is_kept() -> None:
    closed = connect(refuse(409, "This quiz closed on 1 Nov 2026."))
    waiting = outbox.keep(closed, "q", "e", "x = 1\n")
    with pytest.raises(Refusal, match="closed on"):
        outbox.deliver(closed, waiting)
    assert not list(outbox.list_waiting(SITE))
    revoked = connect(refuse(401))
    with pytest.raises(SignInAgain, match="Your answer is kept"):
        outbox.deliver(revoked, outbox.keep(revoked, "q", "e", "x = 1\n"))
    assert len(list(outbox.list_waiting(SITE))) == 1
