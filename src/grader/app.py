"""Puts the service together: settings, database, content, jail, worker, routes."""

import signal
import socket
import sys
import threading
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager
from importlib.metadata import version
from typing import Any, TypeVar

import uvicorn
from fastapi import FastAPI
from fastapi.concurrency import run_in_threadpool
from sqlalchemy.orm import Session

from grader.api import problems, routes
from grader.api.content import Content
from grader.api.context import Context
from grader.api.gate import Gate, Rules
from grader.api.lab_cache import LabCache
from grader.api.rate import RateLimit
from grader.api.signin import Doorstep, Welcome
from grader.identity import Role, create_sign_in_code, create_token, revoke_all
from grader.sandbox.jail import Jail
from grader.settings import Settings, log_to_stderr
from grader.store.database import Database
from grader.web.routes import router as pages
from grader.worker import Worker, worker_of

SHUTDOWN_S = 5
"""How long open event streams may hold up a shutdown [s]."""

FAULT = 3

Result = TypeVar("Result")


def create_app(settings: Settings) -> FastAPI:
    """The whole service as one ASGI app. Raises ContentError where the content has faults."""
    log_to_stderr()
    content = Content(settings.content)
    database = Database(settings.database)
    database.migrate()
    worker = worker_of(settings, database, content)
    app = FastAPI(
        title="MuJoCo grader",
        version=version("mujoco-grader"),
        lifespan=lifespan_of(settings, worker, content),
        docs_url=None,
        redoc_url=None,
        redirect_slashes=False,
    )
    app.state.context = Context(
        database, content, settings.queue_per_user, worker.wake, LabCache(settings.lab_cache_mb * 1024 * 1024)
    )
    app.state.doorstep = Doorstep(database, settings.origin.startswith("https:"), settings.is_local)
    app.state.checks = {"database": lambda: look_at(database), "content": lambda: describe(content)}
    problems.install(app)
    app.include_router(routes.router)
    app.include_router(pages)
    app.add_middleware(Welcome, doorstep=app.state.doorstep)
    rules = Rules(settings.hosts, settings.public_origin, settings.body_kb * 1024)
    limit = RateLimit(settings.rate_per_s, settings.rate_burst)
    app.add_middleware(Gate, database=database, rules=rules, limit=limit)
    return app


def lifespan_of(settings: Settings, worker: Worker, content: Content) -> Any:
    """Starts the jail and the embedded worker with the app, and ends them with it."""

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        if not settings.workers:
            yield
            return
        # In this thread, not in one of a pool: the kernel ends the jail with the thread that started it.
        with Jail(content.library.root / "models", settings.workers, allow_t2=settings.allow_t2) as jail:
            content.run_in(jail.run)
            app.state.checks["jail"] = lambda: inspect(jail)
            worker.start()
            try:
                yield
            finally:
                await run_in_threadpool(worker.stop)

    return lifespan


def look_at(database: Database) -> dict[str, Any]:
    """What /readyz says of the database. Raises where it does not answer."""
    database.ping()
    return {"backend": database.backend}


def describe(content: Content) -> dict[str, Any]:
    """What /readyz says of the content."""
    library = content.library
    return {"quizzes": {quiz_id: library.digest(quiz_id) for quiz_id in library.quizzes}}


def inspect(jail: Jail) -> dict[str, Any]:
    """What /readyz says of the jail: it was attacked, and held, before anything was let in."""
    return {"tier": jail.tier, "self_test": str(jail.self_test), "workers": jail.workers}


def issue_token(settings: Settings, user: str, role: str, course: str | None) -> str:
    """A new bearer token, kept in the database of these settings. Raises Unprocessable."""
    return in_database(settings, lambda session: create_token(session, user, role, course))


def revoke_tokens(settings: Settings, user: str, course: str | None) -> int:
    """Ends whatever lets this user in; how many tokens and sessions that were."""
    return in_database(settings, lambda session: revoke_all(session, user, course))


def sign_in_url(settings: Settings) -> str:
    """Where the instructor signs in, once."""
    code = in_database(settings, lambda session: create_sign_in_code(session, "instructor", Role.INSTRUCTOR))
    return f"{settings.origin}/signin?code={code}"


def in_database(settings: Settings, change: Callable[[Session], Result]) -> Result:
    """What `change` returns, in a transaction on a database opened for it alone."""
    database = Database(settings.database)
    database.migrate()
    try:
        with database.write() as session:
            return change(session)
    finally:
        database.close()


class Server(uvicorn.Server):
    """Says where its pages are as soon as they can be opened, and how well the jail holds."""

    def __init__(self, config: uvicorn.Config, settings: Settings, checks: Mapping[str, Callable[[], Any]]) -> None:
        super().__init__(config)
        self.settings, self.checks = settings, checks

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Binds the port."""
        await super().startup(sockets)
        if self.started:
            port = self.servers[0].sockets[0].getsockname()[1]
            bound = self.settings.model_copy(update={"port": port})
            print(f"Student page:    {bound.origin}/")
            print(f"Instructor page: {sign_in_url(bound)}  (good for one sign-in)")
            if "jail" in self.checks:
                told = self.checks["jail"]()
                print(f"Jail:            tier {told['tier']}, {told['self_test']}", flush=True)


def run_server(settings: Settings) -> None:
    """Serves until it is told to end; SIGHUP loads the content again. Exits 3 where it cannot start."""
    app = create_app(settings)
    content: Content = app.state.context.content
    signal.signal(signal.SIGHUP, lambda *_: threading.Thread(target=content.reload_or_log).start())
    config = uvicorn.Config(
        app,
        host=settings.host,
        port=settings.port,
        log_level="warning",
        access_log=False,
        proxy_headers=False,
        server_header=False,
        timeout_graceful_shutdown=SHUTDOWN_S,
    )
    server = Server(config, settings, app.state.checks)
    server.run()
    if not server.started:
        sys.exit(FAULT)
