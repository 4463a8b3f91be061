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

from grader.api import openapi, problems, routes
from grader.api.admission import AdmissionMiddleware, AdmissionRules
from grader.api.compression import CompressionMiddleware
from grader.api.conditional import ConditionalMiddleware
from grader.api.connections import TimedProtocol
from grader.api.context import Context, context_in
from grader.api.lab_runs import LabRuns
from grader.api.rate import RateLimit
from grader.api.readiness import Check, Readiness
from grader.api.requests import RequestsMiddleware
from grader.api.submissions import HAND_IN
from grader.content import Contents
from grader.courses import people, results
from grader.courses.handing_in import hand_in
from grader.courses.pseudonyms import Blinding
from grader.courses.recomputing import Recomputing
from grader.courses.sign_in import create_sign_in_code
from grader.courses.tokens import create_token, revoke_all
from grader.domain.policy import Extension
from grader.grading_process import Graders
from grader.identity import Role
from grader.library import load
from grader.logs import is_json, log_to_stderr
from grader.monitoring import Monitor, check_content
from grader.queue.worker import Worker
from grader.settings import Settings
from grader.store.database import Database
from grader.store.installation import blind_review_secret
from grader.store.writer import Writer
from grader.web.context import PageContext
from grader.web.provider import Provider
from grader.web.routes import router as pages
from grader.web.sessions import SessionCookies
from grader.worker import graders_of, worker_of

SHUTDOWN_S = 5
"""How long a shutdown waits for open event streams [s]."""

COMPRESSED_BYTES_MIN = 1024
COMPRESSION = 5
"""The gzip level: nearly as small as 9, in a third of the time."""

FAULT = 3

Result = TypeVar("Result")


def create_app(settings: Settings) -> FastAPI:
    """The whole service as one ASGI app. Raises ContentError if the content has faults."""
    log_to_stderr(as_json=is_json(settings.log_format))
    database = Database(settings.database)
    database.migrate()
    content = Contents(settings.content, settings.courses, database)
    graders = graders_of(settings)
    worker = worker_of(settings, database, content.archive, graders)
    labs = LabRuns(settings.lab_cache_mb * 1024 * 1024, settings.lab_steps_per_min)
    monitor = Monitor(database, graders, worker)
    public_origin = settings.public_origin and settings.origin
    context = Context(
        database, content, settings.queue_per_user, labs, Writer(database, partial(hand_in, database)),
        Blinding(blind_review_secret(database)), readiness_of(settings, monitor, content), monitor.exposition,
        settings.metrics_token, public_origin,
    )  # fmt: skip
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
    openapi.install(app)
    app.add_middleware(ConditionalMiddleware)
    app.add_middleware(CompressionMiddleware, minimum_size=COMPRESSED_BYTES_MIN, compresslevel=COMPRESSION)
    app.add_middleware(AdmissionMiddleware, database=database, rules=admission_rules(settings))
    app.add_middleware(RequestsMiddleware)
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


def readiness_of(settings: Settings, monitor: Monitor, content: Contents) -> Readiness:
    """What must work for a server with these settings to be ready. Without grading processes it has no jail."""
    checks: dict[str, Check] = {"database": monitor.check_database, "content": lambda: check_content(content)}
    if settings.workers:
        checks["jail"] = monitor.check_jail
    return Readiness({**checks, "worker": monitor.check_worker})


def lifespan_of(settings: Settings, worker: Worker, graders: Graders, context: Context) -> Any:
    """The app's lifespan: it starts the grading processes, the embedded worker and the thread that recomputes reviews.

    It ends them and the lab runs.
    """
    recomputing = Recomputing(database=context.database, desk_of=context.desk_of)
    context.content.after_reload(recomputing.wake)

    @asynccontextmanager
    async def lifespan(_app: FastAPI) -> AsyncIterator[None]:
        try:
            recomputing.start()
            context.writer.start()
            if settings.workers:
                await run_in_threadpool(graders.start)
                worker.start()
            gc.collect()
            gc.freeze()  # what is there from now on is never walked again
            yield
        finally:
            await run_in_threadpool(recomputing.stop)
            await run_in_threadpool(context.writer.close)
            await run_in_threadpool(worker.stop)
            await run_in_threadpool(graders.close)
            context.labs.close()

    return lifespan


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
            library = load(settings.courses.get(learner.course, settings.content))
            results.grant(database, library, session, learner, quiz, granted=granted, by=None)
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
        log_config=None,
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
    server = Server(config, settings, context.readiness.checks)
    server.run()
    if not server.started:
        sys.exit(FAULT)
