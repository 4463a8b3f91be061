"""A server answers from its first moment, and nothing that is asked while it starts is lost."""

import asyncio
import threading
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

import httpx
import pytest
from fastapi import FastAPI

from grader.errors import ContentError, Fault
from grader.service.serving import StartingApp

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


async def ask(app: Any) -> httpx.Response:
    async with httpx.AsyncClient(transport=httpx.ASGITransport(app), base_url="http://a") as client:
        return await client.get("/page")
