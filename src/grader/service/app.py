"""Assembles the service: settings, database, content, jail, worker, routes."""

from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from functools import partial
from importlib.metadata import version
from typing import Any

from fastapi import FastAPI
from fastapi.concurrency import run_in_threadpool
from uvicorn.middleware.proxy_headers import ProxyHeadersMiddleware

from grader.api import openapi, routes
from grader.api.learning.short_answers import ShortAnswersMiddleware
from grader.courses.answering.intake import store_answers
from grader.courses.people.pseudonyms import Blinding
from grader.courses.reporting.class_answers import ClassReader
from grader.courses.reporting.quiz_statistics import Statistics
from grader.courses.reviewing.rubric_changes import Recomputing
from grader.courses.sending.outbox import release_all
from grader.gate import problems
from grader.gate.admission import AdmissionMiddleware, AdmissionRules
from grader.gate.lab_runs import LabRuns
from grader.gate.monitoring import Monitor, check_content, check_mujoco
from grader.gate.openid import Provider
from grader.gate.rate import RateLimit
from grader.gate.readiness import Check, Readiness
from grader.gate.requests import RequestsMiddleware
from grader.gate.services import Services
from grader.grading.content import Contents
from grader.grading.processes import Graders
from grader.library import PassedChecks
from grader.logs import is_json, log_to_stderr
from grader.platforms.keys import ToolKeys
from grader.platforms.launching.fetching import PlatformKeys
from grader.platforms.tool import Tool, is_installed
from grader.service.deliveries import build_deliveries
from grader.service.opening import end_start, never, open_database
from grader.service.worker import build_graders, build_worker
from grader.settings import Settings
from grader.store.engine.database import Database
from grader.store.engine.group_commit import GroupCommit
from grader.store.upkeep.installation import blind_review_secret
from grader.web.frame.errors import error_page
from grader.web.frame.rendering import keep_compiled
from grader.web.routes import router as pages


def create_app(settings: Settings, graders: Graders | None = None, is_ending: Callable[[], bool] = never) -> FastAPI:
    """The whole service as one ASGI app; `graders` may have begun. Raises ContentError if the content has faults, and
    InterruptedError once `is_ending` while the database does not answer."""
    log_to_stderr(as_json=is_json(settings.log_format))
    services = build_services(settings, graders or build_graders(settings), is_ending)
    app = FastAPI(
        title="MuJoCo grader",
        version=version("mujoco-grader"),
        lifespan=build_lifespan(services),
        docs_url=None,
        redoc_url=None,
        redirect_slashes=False,
        telemetry={"tracing": False, "metrics": False, "logs": False},  # /metrics and the log tell it
    )
    app.state.services = services
    problems.install(app, error_page)
    routes.include_in(app)
    app.routes.extend(pages.routes)
    openapi.install(app, settings.origin if settings.public_origin else None)
    # `add_middleware` would put ours behind FastAPI's own, which an answer does not need and waits for.
    answers = ShortAnswersMiddleware(app.build_middleware_stack(), services)
    admitted = AdmissionMiddleware(answers, services.database, services.admission, app.routes)
    app.middleware_stack = RequestsMiddleware(admitted)
    if settings.trusted_proxies:
        hosts = list(map(str, settings.trusted_proxies))
        app.middleware_stack = ProxyHeadersMiddleware(app.middleware_stack, hosts)  # type: ignore[arg-type, assignment]
    return app


def build_services(settings: Settings, graders: Graders, is_ending: Callable[[], bool]) -> Services:
    """Builds the objects that the routes share, on a migrated database. Nothing is started yet."""
    database = open_database(settings, is_ending)
    passed = PassedChecks(settings.cache)
    keep_compiled(passed.place)
    content = Contents(settings.content, settings.courses, database, passed)
    worker = build_worker(
        settings, database, content.archive, graders, build_deliveries(settings, database, content.archive)
    )
    monitor = Monitor(database, graders, worker)
    return Services(
        settings=settings,
        database=database,
        content=content,
        writer=GroupCommit(database, partial(store_answers, database)),
        blinding=Blinding(blind_review_secret(database)),
        labs=LabRuns(settings.lab_cache_mb * 1024 * 1024, int(settings.share(settings.lab_steps_per_min))),
        admission=admission_rules(settings),
        monitor=monitor,
        readiness=build_readiness(settings, monitor, content),
        statistics=Statistics(database),
        classes=ClassReader(database),
        provider=build_provider(settings),
        tool=build_tool(settings, database),
    )


def admission_rules(settings: Settings) -> AdmissionRules:
    """What the settings say about admission."""
    return AdmissionRules(
        settings.hosts,
        settings.public_origin,
        settings.body_kb * 1024,
        by_user=rate_limit(settings, settings.rate_per_s, settings.rate_burst),
        by_address=rate_limit(settings, settings.address_rate_per_s, settings.address_rate_burst),
    )


def rate_limit(settings: Settings, rate_per_s: float, burst: int) -> RateLimit:
    """This process's share of a limit of the installation; at least one request may come."""
    return RateLimit(settings.share(rate_per_s), max(1.0, settings.share(burst)))


def build_provider(settings: Settings) -> Provider | None:
    """The OpenID provider of the settings, if they name one."""
    if settings.oidc_issuer is None or settings.oidc_client_id is None:
        return None
    secret = settings.oidc_client_secret
    text = None if secret is None else secret.get_secret_value()
    return Provider(settings.oidc_issuer, settings.oidc_client_id, text, settings.oidc_course)


def build_tool(settings: Settings, database: Database) -> Tool | None:
    """The LTI tool; None without the packages of its extra."""
    if not is_installed():
        return None
    from grader.platforms.sending.access_tokens import AccessTokens
    from grader.platforms.sending.outgoing import Outgoing

    keys, outgoing = ToolKeys(database), Outgoing(settings.private_hosts)
    return Tool(keys, PlatformKeys(outgoing), outgoing, AccessTokens(outgoing, keys.sign))


def build_readiness(settings: Settings, monitor: Monitor, content: Contents) -> Readiness:
    """What must work for a server with these settings to be ready. Without grading processes it has no jail."""
    checks: dict[str, Check] = {"database": monitor.check_database, "content": lambda: check_content(content)}
    checks["mujoco"] = check_mujoco
    if settings.workers:
        checks["jail"] = monitor.check_jail
    return Readiness({**checks, "worker": monitor.check_worker})


def build_lifespan(services: Services) -> Any:
    """The app's lifespan: it starts the grading processes, the embedded worker and the thread that recomputes reviews.
    It ends them and the lab runs. Held scores are looked at again, now and after each change of the content."""
    database, graders, worker = services.database, services.monitor.graders, services.monitor.worker
    recomputing = Recomputing(database=database, desk_of=services.desk_of)
    services.content.add_listener(recomputing.wake)
    services.content.add_listener(partial(release_all, database))

    @asynccontextmanager
    async def lifespan(_app: FastAPI) -> AsyncIterator[None]:
        try:
            recomputing.start()
            services.writer.start()
            await run_in_threadpool(release_all, database)
            end_start()
            if services.settings.workers:
                await run_in_threadpool(graders.start)
                worker.start()
            yield
        finally:
            await run_in_threadpool(recomputing.stop)
            await run_in_threadpool(services.writer.close)
            await run_in_threadpool(worker.stop)
            await run_in_threadpool(graders.close)
            services.labs.close()

    return lifespan
