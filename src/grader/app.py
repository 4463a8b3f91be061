"""Assembles the service: settings, database, content, jail, worker, routes."""

import gc
import signal
import socket
import sys
import threading
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager
from functools import partial
from importlib.metadata import version
from typing import Any, TypeVar

import uvicorn
from fastapi import FastAPI
from fastapi.concurrency import run_in_threadpool
from sqlalchemy.orm import Session
from uvicorn.middleware.proxy_headers import ProxyHeadersMiddleware

from grader.api import problems, routes
from grader.api.admission import AdmissionMiddleware, AdmissionRules
from grader.api.connections import TimedProtocol
from grader.api.context import Check, Context, context_in
from grader.api.lab_runs import LabRuns
from grader.api.rate import RateLimit
from grader.api.submissions import HAND_IN
from grader.content import Content
from grader.courses import people, results
from grader.courses.handing_in import hand_in
from grader.courses.sign_in import create_sign_in_code
from grader.courses.tokens import create_token, revoke_all
from grader.domain.policy import Extension
from grader.grading_process import Graders
from grader.identity import Role
from grader.library import load
from grader.queue.worker import Worker
from grader.settings import Settings, log_to_stderr
from grader.store.database import Database
from grader.store.installation import hidden_case_secret
from grader.store.writer import Writer
from grader.web.context import PageContext
from grader.web.provider import Provider
from grader.web.routes import router as pages
from grader.web.sessions import SessionCookies
from grader.worker import graders_of, worker_of

SHUTDOWN_S = 5
"""How long a shutdown waits for open event streams [s]."""

FAULT = 3

Result = TypeVar("Result")


def create_app(settings: Settings) -> FastAPI:
    """The whole service as one ASGI app. Raises ContentError if the content has faults."""
    log_to_stderr()
    database = Database(settings.database)
    database.migrate()
    content = Content(settings.content, hidden_case_secret(database))
    graders = graders_of(settings, content)
    worker = worker_of(settings, database, content, graders)
    labs = LabRuns(settings.lab_cache_mb * 1024 * 1024, settings.lab_steps_per_min)
    checks: dict[str, Check] = {"database": lambda: check_database(database), "content": lambda: check_content(content)}
    public_origin = settings.public_origin and settings.origin
    writer = Writer(database, partial(hand_in, database))
    context = Context(database, content, settings.queue_per_user, labs, writer, checks, public_origin)
    sessions = SessionCookies(database, settings.origin.startswith("https:"), settings.is_local)
    app = FastAPI(
        title="MuJoCo grader",
        version=version("mujoco-grader"),
        lifespan=lifespan_of(settings, worker, graders, context),
        docs_url=None,
        redoc_url=None,
        redirect_slashes=False,
    )
    app.state.context = context
    app.state.pages = PageContext(content, sessions, public_origin, provider_of(settings))
    problems.install(app)
    app.router.routes.append(HAND_IN)
    app.include_router(routes.router)
    app.include_router(pages)
    app.add_middleware(AdmissionMiddleware, database=database, rules=admission_rules(settings))
    if settings.trusted_proxies:
        app.add_middleware(ProxyHeadersMiddleware, trusted_hosts=list(map(str, settings.trusted_proxies)))
    return app


def admission_rules(settings: Settings) -> AdmissionRules:
    """What the settings say about admission."""
    return AdmissionRules(
        settings.hosts,
        settings.public_origin,
        settings.body_kb * 1024,
        by_user=RateLimit(settings.rate_per_s, settings.rate_burst),
        by_address=RateLimit(settings.address_rate_per_s, settings.address_rate_burst),
    )


def provider_of(settings: Settings) -> Provider | None:
    """The OpenID provider of the settings, if they name one."""
    if settings.oidc_issuer is None or settings.oidc_client_id is None:
        return None
    secret = settings.oidc_client_secret
    text = None if secret is None else secret.get_secret_value()
    return Provider(settings.oidc_issuer, settings.oidc_client_id, text, settings.oidc_course)


def lifespan_of(settings: Settings, worker: Worker, graders: Graders, context: Context) -> Any:
    """The app's lifespan: it starts the grading processes and the embedded worker, and ends them and the lab runs."""

    @asynccontextmanager
    async def lifespan(_app: FastAPI) -> AsyncIterator[None]:
        try:
            context.writer.start()
            if settings.workers:
                await run_in_threadpool(graders.start)
                context.checks["jail"] = lambda: check_jail(graders)
                context.checks["worker"] = lambda: check_worker(worker)
                worker.start()
            gc.collect()
            gc.freeze()  # what is there from now on is never walked again
            yield
        finally:
            await run_in_threadpool(context.writer.close)
            await run_in_threadpool(worker.stop)
            await run_in_threadpool(graders.close)
            context.labs.close()

    return lifespan


def check_database(database: Database) -> dict[str, Any]:
    """The state of the database for /readyz. Raises if it does not answer."""
    database.ping()
    return {"backend": database.backend}


def check_content(content: Content) -> dict[str, Any]:
    """The quizzes that are loaded, with their digests, for /readyz."""
    library = content.library
    return {"quizzes": {quiz_id: library.digest(quiz_id) for quiz_id in library.quizzes}}


def check_jail(graders: Graders) -> dict[str, Any]:
    """The jail's tier and the result of its self-test, for /readyz."""
    return {**graders.jail, "workers": len(graders.pids())}


def check_worker(worker: Worker) -> dict[str, Any]:
    """The number of jobs that the embedded worker does at a time, for /readyz. Raises if a thread of it has ended."""
    if not worker.alive:
        raise RuntimeError("The embedded worker has ended.")
    return {"threads": worker.threads}


def issue_token(settings: Settings, user: str, role: str, course: str | None) -> str:
    """Creates a bearer token in the database of these settings. Raises Unprocessable."""
    return in_database(settings, lambda session: create_token(session, user, role, course))


def revoke_tokens(settings: Settings, user: str, course: str | None) -> int:
    """Revokes the tokens and sessions of a user. Returns how many were valid."""
    return in_database(settings, lambda session: revoke_all(session, user, course))


def give_extension(settings: Settings, key: tuple[str | None, str, str], granted: Extension) -> None:
    """Gives (course, quiz, user) an extension. Raises NotFound if the course has no such quiz, and Unprocessable."""
    course, quiz, user = key
    database = Database(settings.database)
    database.migrate()
    try:
        with database.write() as session:
            learner = people.named(session, user, Role.STUDENT, course)
            results.grant(database, load(settings.content), session, learner, quiz, granted=granted, by=None)
    finally:
        database.close()


def sign_in_url(settings: Settings) -> str:
    """The address where the instructor signs in; good for one sign-in."""
    code = in_database(settings, lambda session: create_sign_in_code(session, "instructor", Role.INSTRUCTOR))
    return f"{settings.origin}/signin?code={code}"


def in_database(settings: Settings, change: Callable[[Session], Result]) -> Result:
    """Calls `change` in a transaction on a newly opened database, and returns its result."""
    database = Database(settings.database)
    database.migrate()
    try:
        with database.write() as session:
            return change(session)
    finally:
        database.close()


class Server(uvicorn.Server):
    """Prints the addresses of the pages as soon as they can be opened, and the state of the jail."""

    def __init__(self, config: uvicorn.Config, settings: Settings, checks: Mapping[str, Check]) -> None:
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
                jail = self.checks["jail"]()
                print(f"Jail:            tier {jail['tier']}, {jail['self_test']}", flush=True)


def server_config(app: FastAPI, settings: Settings) -> uvicorn.Config:
    """How uvicorn serves the app. It knows no proxies: `create_app` adds those of the settings."""
    return uvicorn.Config(
        app,
        http=TimedProtocol,
        ws="none",
        host=settings.host,
        port=settings.port,
        log_level="warning",
        access_log=False,
        proxy_headers=False,
        server_header=False,
        timeout_graceful_shutdown=SHUTDOWN_S,
    )


def run_server(settings: Settings) -> None:
    """Serves until a signal ends it; SIGHUP loads the content again. Exits 3 if it cannot start."""
    app = create_app(settings)
    context = context_in(app)
    signal.signal(signal.SIGHUP, lambda *_: threading.Thread(target=context.content.reload_or_log).start())
    config = server_config(app, settings)
    server = Server(config, settings, context.checks)
    server.run()
    if not server.started:
        sys.exit(FAULT)
