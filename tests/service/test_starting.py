"""A server answers from its first moment, and nothing that is asked while it starts is lost."""

import asyncio
import signal
import sqlite3
import threading
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import httpx
import pytest
from fastapi import FastAPI
from sqlalchemy.exc import OperationalError

from grader.errors import ContentError, Fault, NotReady
from grader.service.processes import open_listener
from grader.service.serving import StartingApp, run_app
from grader.settings import Settings
from grader.store.engine.database import FULL

PATIENCE_S = 30.0


def build_service(events: list[str]) -> FastAPI:
    @asynccontextmanager
    async def lifespan(_app: FastAPI) -> AsyncIterator[None]:
        events.append("begins")
        yield
        events.append("ends")

    app = FastAPI(lifespan=lifespan)
    app.get("/page")(lambda: "the page")
    app.get("/healthz")(lambda: "of the service")
    return app


class Lifespan:
    """What a server says to an app about its life."""

    def __init__(self, app: StartingApp) -> None:
        self.asked: asyncio.Queue[dict[str, str]] = asyncio.Queue()
        self.told: asyncio.Queue[dict[str, str]] = asyncio.Queue()
        self.task = asyncio.create_task(app({"type": "lifespan"}, self.asked.get, self.told.put))

    async def say(self, word: str) -> None:
        """Says startup or shutdown, and waits until it is complete."""
        await self.asked.put({"type": f"lifespan.{word}"})
        told = await asyncio.wait_for(self.told.get(), PATIENCE_S)
        assert told == {"type": f"lifespan.{word}.complete"}


def test_it_is_alive_while_it_starts_and_what_is_asked_waits() -> None:
    events: list[str] = []
    go_on = threading.Event()

    def build() -> FastAPI:
        assert go_on.wait(PATIENCE_S)
        return build_service(events)

    async def run() -> None:
        app = StartingApp(build)
        life = Lifespan(app)
        await life.say("startup")
        async with httpx.AsyncClient(transport=httpx.ASGITransport(app), base_url="http://a") as client:
            assert (await client.get("/healthz")).json() == {"status": "ok"}
            unready = await client.get("/readyz")
            assert (unready.status_code, unready.headers["retry-after"]) == (503, "1")
            assert unready.json()["detail"].startswith("It starts: the content is loaded")
            page, given_up = (asyncio.create_task(client.get("/page")) for _ in range(2))
            await asyncio.sleep(0.05)
            assert not page.done()
            given_up.cancel()
            go_on.set()
            assert (await asyncio.wait_for(page, PATIENCE_S)).json() == "the page"
            assert (await client.get("/healthz")).json() == "of the service"
        assert events == ["begins"]
        await life.say("shutdown")
        assert events == ["begins", "ends"]
        await life.task

    asyncio.run(run())


@pytest.mark.parametrize("is_refused", [True, False], ids=["refused", "ended while it starts"])
def test_a_start_that_fails_answers_what_waited_and_says_why(is_refused: bool) -> None:
    events: list[str] = []

    async def run() -> StartingApp:
        ending = threading.Event()

        def build() -> FastAPI:
            if is_refused:
                raise ContentError([Fault("quizzes/a.json", "id", "is missing")])
            assert ending.wait(PATIENCE_S)
            return build_service(events)

        app = StartingApp(build)
        waiting = asyncio.create_task(ask(app))
        life = Lifespan(app)
        await life.say("startup")
        asyncio.get_running_loop().call_later(0.05, ending.set)
        await life.say("shutdown")
        assert (await asyncio.wait_for(waiting, PATIENCE_S)).status_code == 503
        return app

    error = asyncio.run(run()).opened.exception()
    assert isinstance(error, ContentError if is_refused else InterruptedError)
    assert events == []


def test_a_disk_that_fills_up_during_the_start_is_one_sentence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The database is open by then: its first rows find no room."""

    def create(*_: object) -> FastAPI:
        error = sqlite3.OperationalError("database or disk is full")
        error.sqlite_errorcode = sqlite3.SQLITE_FULL
        raise OperationalError(None, None, error)

    monkeypatch.setattr("grader.service.app.create_app", create)
    monkeypatch.setattr("shutil.disk_usage", lambda _: SimpleNamespace(free=1 << 20))
    hang_up = signal.getsignal(signal.SIGHUP)
    try:
        with open_listener("127.0.0.1", 0) as listener, pytest.raises(NotReady) as refused:
            run_app(Settings(data=tmp_path), listener, print)
    finally:
        signal.signal(signal.SIGHUP, hang_up)
    assert str(refused.value) == f"{FULL} Make room for {tmp_path}/grader.db."


async def ask(app: Any) -> httpx.Response:
    async with httpx.AsyncClient(transport=httpx.ASGITransport(app), base_url="http://a") as client:
        return await client.get("/page")
