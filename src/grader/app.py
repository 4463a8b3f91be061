"""Assembles the service: settings, database, content, jail, worker, routes."""

import gc
import signal
import socket
import sys
import threading
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from functools import partial
from importlib.metadata import version
from typing import Any

import uvicorn
from fastapi import FastAPI
from fastapi.concurrency import run_in_threadpool
from uvicorn.middleware.proxy_headers import ProxyHeadersMiddleware

from grader.accounts import tell_addresses
from grader.api import openapi, problems, routes
from grader.api.admission import AdmissionMiddleware, AdmissionRules
from grader.api.compression import CompressionMiddleware
from grader.api.conditional import ConditionalMiddleware
from grader.api.connections import TimedProtocol
from grader.api.context import Context, context_in
from grader.api.lab_runs import LabRuns
from grader.api.on_behalf import HAND_IN_ON_BEHALF
from grader.api.rate import RateLimit, SharedBuckets
from grader.api.readiness import Check, Readiness
from grader.api.requests import RequestsMiddleware
from grader.api.shortcut import Shortcut
from grader.api.submissions import HAND_IN
from grader.content import Contents
from grader.courses.handing_in import hand_in
from grader.courses.outbox import release_all
from grader.courses.pseudonyms import Blinding
from grader.courses.recomputing import Recomputing
from grader.deliveries import deliveries_of
from grader.grading_process import Graders
from grader.lms.fetching import PlatformKeys
from grader.lms.keys import ToolKeys
from grader.lms.tool import Tool, is_installed
from grader.logs import is_json, log_to_stderr
from grader.monitoring import Monitor, check_content
from grader.queue.worker import Worker
from grader.settings import Settings
from grader.store.database import Database
from grader.store.installation import blind_review_secret
from grader.store.writer import Writer
from grader.web.context import PageContext
from grader.web.errors import PageErrors
from grader.web.provider import Provider
from grader.web.routes import router as pages
from grader.web.sessions import SessionCookies
from grader.worker import graders_of, worker_of

SHUTDOWN_S = 5
"""How long a shutdown waits for open event streams [s]."""

COMPRESSED_BYTES_MIN = 1024
COMPRESSION = 5
"""The gzip level: nearly as small as 9, in a third of the time."""

SWITCH_S = 0.0005
"""How long a thread keeps the interpreter while another waits for it [s]: the event loop is always busy, and the writer
waits after every answer of the database. Python's own 5 ms would be most of the time that a batch takes."""

YOUNG_OBJECTS = 10_000
"""New objects between two looks for garbage cycles; Python's own 700 cost a tenth of every request."""

FAULT = 3


def create_app(settings: Settings, buckets: SharedBuckets | None = None) -> FastAPI:
    """The whole service as one ASGI app. Raises ContentError if the content has faults.

    Rate limits count in `buckets` together with other processes.
    """
    log_to_stderr(as_json=is_json(settings.log_format))
    database = Database(settings.database, settings.connections)
    database.migrate()
    content = Contents(settings.content, settings.courses, database)
    graders = graders_of(settings)
    worker = worker_of(settings, database, content.archive, graders, deliveries_of(settings, database, content.archive))
    labs = LabRuns(settings.lab_cache_mb * 1024 * 1024, settings.lab_steps_per_min, buckets)
    monitor = Monitor(database, graders, worker)
    public_origin, tool = settings.public_origin and settings.origin, tool_of(settings, database)
    rules = admission_rules(settings, buckets)
    context = Context(
        database, content, settings.queue_per_user, labs, Writer(database, partial(hand_in, database)),
        Blinding(blind_review_secret(database)), readiness_of(settings, monitor, content), rules.by_user,
        monitor.exposition, settings.metrics_token, public_origin, settings.private_hosts, tool,
    )  # fmt: skip
    sessions = SessionCookies(database, settings.origin.startswith("https:"), settings.is_local)
    app = FastAPI(
        title="MuJoCo grader",
        version=version("mujoco-grader"),
        lifespan=lifespan_of(settings, worker, graders, context),
        docs_url=None,
        redoc_url=None,
        redirect_slashes=False,
        telemetry={"tracing": False, "metrics": False, "logs": False},  # /metrics and the log tell it
    )
    app.state.context = context
    app.state.pages = PageContext(
        content, sessions, public_origin, provider_of(settings), tool, context.writer, settings.queue_per_user,
        context.blinding, worker.alive_on, context.statistics,
    )  # fmt: skip
    problems.install(app)
    app.include_router(routes.router)
    app.include_router(pages)
    openapi.install(app)
    app.add_middleware(ConditionalMiddleware)
    app.add_middleware(CompressionMiddleware, minimum_size=COMPRESSED_BYTES_MIN, compresslevel=COMPRESSION)
    app.add_middleware(Shortcut, routes=[HAND_IN, HAND_IN_ON_BEHALF], handlers=app.exception_handlers)
    app.add_middleware(AdmissionMiddleware, database=database, rules=rules)
    app.add_middleware(PageErrors)
    app.add_middleware(RequestsMiddleware)
    if settings.trusted_proxies:
        app.add_middleware(ProxyHeadersMiddleware, trusted_hosts=list(map(str, settings.trusted_proxies)))
    return app


def admission_rules(settings: Settings, buckets: SharedBuckets | None) -> AdmissionRules:
    """What the settings say about admission."""
    return AdmissionRules(
        settings.hosts,
        settings.public_origin,
        settings.body_kb * 1024,
        by_user=RateLimit(settings.rate_per_s, settings.rate_burst, buckets=buckets and buckets.of("user")),
        by_address=RateLimit(
            settings.address_rate_per_s, settings.address_rate_burst, buckets=buckets and buckets.of("address")
        ),
    )


def provider_of(settings: Settings) -> Provider | None:
    """The OpenID provider of the settings, if they name one."""
    if settings.oidc_issuer is None or settings.oidc_client_id is None:
        return None
    secret = settings.oidc_client_secret
    text = None if secret is None else secret.get_secret_value()
    return Provider(settings.oidc_issuer, settings.oidc_client_id, text, settings.oidc_course)


def tool_of(settings: Settings, database: Database) -> Tool | None:
    """The LTI tool; None without the packages of its extra."""
    if not is_installed():
        return None
    from grader.lms.access_tokens import AccessTokens
    from grader.lms.outgoing import Outgoing

    keys, outgoing = ToolKeys(database), Outgoing(settings.private_hosts)
    return Tool(keys, PlatformKeys(outgoing), outgoing, AccessTokens(outgoing, keys.sign))


def readiness_of(settings: Settings, monitor: Monitor, content: Contents) -> Readiness:
    """What must work for a server with these settings to be ready. Without grading processes it has no jail."""
    checks: dict[str, Check] = {"database": monitor.check_database, "content": lambda: check_content(content)}
    if settings.workers:
        checks["jail"] = monitor.check_jail
    return Readiness({**checks, "worker": monitor.check_worker})


def lifespan_of(settings: Settings, worker: Worker, graders: Graders, context: Context) -> Any:
    """The app's lifespan: it starts the grading processes, the embedded worker and the thread that recomputes reviews.

    It ends them and the lab runs. Held scores are looked at again, now and after each change of the content.
    """
    recomputing = Recomputing(database=context.database, desk_of=context.desk_of)
    context.content.after_reload(recomputing.wake)
    context.content.after_reload(partial(release_all, context.database))

    @asynccontextmanager
    async def lifespan(_app: FastAPI) -> AsyncIterator[None]:
        try:
            recomputing.start()
            context.writer.start()
            await run_in_threadpool(release_all, context.database)
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


class Server(uvicorn.Server):
    """Calls `ready` with its port as soon as pages can be opened."""

    def __init__(self, config: uvicorn.Config, ready: Callable[[int], None]) -> None:
        super().__init__(config)
        self.ready = ready

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Binds the port, or takes the sockets."""
        await super().startup(sockets)
        if self.started:
            self.ready(self.servers[0].sockets[0].getsockname()[1])


def server_config(app: FastAPI, settings: Settings) -> uvicorn.Config:
    """How uvicorn serves the app. It knows no proxies: `create_app` adds those of the settings."""
    return uvicorn.Config(
        app,
        http=TimedProtocol,
        ws="none",
        loop="uvloop",
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
    """Serves in this process. Exits 3 if it cannot start."""

    def ready(port: int, app: FastAPI) -> None:
        checks = context_in(app).readiness.checks
        tell_addresses(settings.model_copy(update={"port": port}), checks["jail"]() if "jail" in checks else {})

    run_app(settings, ready)


def run_app(
    settings: Settings,
    ready: Callable[[int, FastAPI], None],
    listener: socket.socket | None = None,
    buckets: SharedBuckets | None = None,
) -> None:
    """Serves until a signal ends it, on this listener or a port of its own; SIGHUP loads the content again.

    Calls `ready` with the port and the app. Exits 3 if it cannot start.
    """
    sys.setswitchinterval(SWITCH_S)
    gc.set_threshold(YOUNG_OBJECTS)
    app = create_app(settings, buckets)
    context = context_in(app)
    signal.signal(signal.SIGHUP, lambda *_: threading.Thread(target=context.content.reload_or_log).start())
    config = server_config(app, settings)
    server = Server(config, lambda port: ready(port, app))
    server.run(None if listener is None else [listener])
    if not server.started:
        sys.exit(FAULT)
