"""A real browser, a platform and a grader on two sites: in a frame, with the platform's storage, and in a new tab."""

import json
import time
from collections.abc import Iterator
from dataclasses import dataclass
from html import escape
from typing import Any
from urllib.parse import parse_qsl, urlencode

import pytest
from fastapi import FastAPI, Request
from fastapi.responses import HTMLResponse
from playwright.sync_api import BrowserContext, FrameLocator, Page, expect
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from grader.courses.people import platforms as rules
from grader.service.app import create_app
from grader.settings import Settings
from grader.store import platforms
from platforms.certificates import contexts
from platforms.platform import AGS, AGS_SCOPE, CLAIM, INSTRUCTOR, Platform, selection_claims
from support.proxies import free_port
from support.servers import serving
from web.browsing import Chromium, bounded, chromium

PATIENCE_MS = 30_000
expect.set_options(timeout=PATIENCE_MS)

QUIZ, QUESTION = "1.3-check", "q2"
SCOPES = [f"{AGS_SCOPE}score", f"{AGS_SCOPE}result.readonly", f"{AGS_SCOPE}lineitem"]

STORE = """
const kept = {};
addEventListener("message", (event) => {
  const { subject, key, value, message_id } = event.data;
  if (event.origin !== "TOOL" || !String(subject).startsWith("lti.")) return;
  if (subject === "lti.put_data") kept[key] = value;
  parent.document.title = `${subject} ${parent.document.title}`;
  event.source.postMessage({ subject: `${subject}.response`, message_id, key, value: kept[key] }, event.origin);
});
"""
"""The frame in which a platform keeps values for its tools."""


OPTIONS = (
    "--host-resolver-rules=MAP *.test 127.0.0.1",
    "--ignore-certificate-errors",
    # Playwright can wait for ever for a frame that went to another process and back. What a frame may keep, show and
    # send is a matter of sites, not of processes.
    "--disable-site-isolation-trials",
)


@dataclass
class WithoutCookies:
    """The grader, for a browser that takes no cookies in frames while this is switched on."""

    app: ASGIApp
    on: bool = False

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        in_frame = (b"sec-fetch-dest", b"iframe") in scope.get("headers", ())

        async def send_without(message: Message) -> None:
            if message["type"] == "http.response.start" and in_frame and self.on:
                message["headers"] = [pair for pair in message["headers"] if pair[0].lower() != b"set-cookie"]
            await send(message)

        await self.app(scope, receive, send_without)


@dataclass
class World:
    """A grader and a platform on two sites of their own, and a browser."""

    grader: str
    platform: Platform
    browser: Chromium
    claims: dict[str, Any]
    cookieless: WithoutCookies

    def login(self, **more: str) -> str:
        return f"{self.grader}/lti/login?{urlencode({**self.platform.login(self.grader), **more})}"

    def context(self) -> BrowserContext:
        return self.browser.new_context(ignore_https_errors=True)

    def framed(self, page: Page, storage: str = "") -> FrameLocator:
        """Opens the platform's page, which shows the grader in a frame."""
        login = self.login(**({"lti_storage_target": storage} if storage else {}))
        page.goto(f"{self.platform.origin}/course?{urlencode({'login': login, 'storage': storage})}")
        return page.frame_locator("#tool")


def pages_of(platform: Platform, claims: dict[str, Any]) -> FastAPI:
    """What a platform shows its users: a page with a frame and a link, and the form that posts a launch."""
    app = FastAPI()

    @app.get("/course")
    def course(login: str, storage: str) -> HTMLResponse:
        keeper = f'<iframe name="{escape(storage)}" src="/store"></iframe>' if storage else ""
        frame = f'<iframe id="tool" width="1000" height="700" src="{escape(login)}"></iframe>'
        link = f'<a href="{escape(login)}" target="_blank">Open</a>'
        return HTMLResponse(f"<title>Course</title>{keeper}{link}{frame}")

    @app.get("/store")
    def store() -> HTMLResponse:
        return HTMLResponse(f"<script>{STORE.replace('TOOL', claims['tool'])}</script>")

    @app.get("/auth")
    def auth(request: Request) -> HTMLResponse:
        asked = platform.read_authentication_request(str(request.url), claims["tool"])
        made = claims["make"](asked) if "make" in claims else platform.claims(asked, **claims["changes"])
        fields = {"state": asked["state"], "id_token": platform.sign(made)}
        inputs = "".join(f'<input type="hidden" name="{name}" value="{value}">' for name, value in fields.items())
        action = escape(asked["redirect_uri"])
        return HTMLResponse(
            f'<form method="post" action="{action}">{inputs}</form><script>document.forms[0].submit()</script>'
        )

    @app.post("/return")
    async def returned(request: Request) -> HTMLResponse:
        form = dict(parse_qsl((await request.body()).decode()))
        said = platform.read_selection(form["JWT"], platform.tool_keys)
        return HTMLResponse(f"<h1>Taken</h1><pre>{escape(json.dumps(said))}</pre>")

    return app


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Iterator[World]:
    folder = tmp_path_factory.mktemp("world")
    contexts("sites.test", folder)  # the browser is told to take any certificate
    certificate, ports = folder / "host.pem", (free_port(), free_port())
    grader, origin = f"https://grader.test:{ports[0]}", f"https://platform.test:{ports[1]}"
    platform, claims = Platform(origin), {"tool": grader, "changes": {}}
    settings = Settings(data=folder / "data", workers=1, public_origin=grader, private_hosts=("127.0.0.1",))
    app = create_app(settings)
    grader_app = WithoutCookies(app)
    with (
        serving(platform.app()) as platform.services,
        serving(grader_app, port=ports[0], certificate=certificate),
        serving(pages_of(platform, claims), port=ports[1], certificate=certificate),
        chromium(*OPTIONS) as browser,
    ):
        register(app, platform)
        yield World(grader, platform, browser, claims, grader_app)
    app.state.services.database.close()


def register(app: FastAPI, platform: Platform) -> None:
    """The platform is approved, and its course linked with the default one, which has the lesson."""
    platform.tool_keys = app.state.services.tool.keys.public()
    with app.state.services.database.write() as session:
        row = rules.add(session, None, platform.registration, platform.deployment_id)
        rules.approve(session, None, row.id)
        context = platforms.get_context(session, row.id, platform.deployment_id, "context-1", "Robotics")
        session.flush()
        rules.link(session, None, context.id, "default")


@pytest.fixture(autouse=True)
def limit() -> Iterator[None]:
    """No launch hangs for ever."""
    with bounded():
        yield


def of_learner(world: World, subject: str, *, cookieless: bool = False) -> None:
    """The next launches are of this learner, by a link to a quiz with a line item."""
    world.cookieless.on = cookieless
    services = {"scope": SCOPES, "lineitem": f"{world.platform.services}/lineitem"}
    world.claims.pop("make", None)
    world.claims["changes"] = {
        "sub": subject, "name": f"Learner {subject}", AGS: services, f"{CLAIM}custom": {"quiz": QUIZ},
    }  # fmt: skip


def answer(shown: Page | FrameLocator) -> None:
    """Answers a question rightly, and sees the verdict."""
    card = shown.locator(f'[id="{QUIZ}--{QUESTION}"]')
    card.locator("input[name=answer]").fill("5 ms")
    card.locator("form button").click()
    expect(card.locator("[data-status]").first).to_contain_text("orrect")


def scores_of(platform: Platform, subject: str) -> list[dict[str, Any]]:
    """The scores that have come for a learner; waits for the first."""
    deadline = time.monotonic() + PATIENCE_MS / 1000
    while not (scores := [score for score in platform.scores if score["userId"] == subject]):
        assert time.monotonic() < deadline, "no score has come"
        time.sleep(0.05)
    return scores


def session_cookie(context: BrowserContext, site: str) -> dict[str, Any]:
    [cookie] = [dict(cooky) for cooky in context.cookies(site) if cooky["name"] == "__Host-grader_session"]
    return cookie


def test_in_a_frame_through_to_a_score_at_the_platform(world: World) -> None:
    of_learner(world, "framed")
    with world.context() as context:
        page = context.new_page()
        frame = world.framed(page)
        answer(frame)
        cookie = session_cookie(context, world.grader)
        assert cookie["partitionKey"].startswith("https://platform.test")
        assert (cookie["sameSite"], cookie["secure"], cookie["httpOnly"]) == ("None", True, True)
    [score] = scores_of(world.platform, "framed")
    assert score["scoreGiven"] > 0


def test_in_a_new_tab_through_to_a_score_at_the_platform(world: World) -> None:
    of_learner(world, "in a tab")
    with world.context() as context:
        page = context.new_page()
        page.goto(f"{world.platform.origin}/course?{urlencode({'login': world.login(), 'storage': ''})}")
        expect(page.frame_locator("#tool").locator(f'[id="{QUIZ}"]')).to_be_visible()
        context.clear_cookies()
        with context.expect_page() as opened:
            page.get_by_role("link", name="Open").click()
        tab = opened.value
        answer(tab)
        assert tab.url.startswith(f"{world.grader}/")
        cookie = session_cookie(context, world.grader)
        assert "partitionKey" not in cookie
        assert cookie["sameSite"] == "Lax"
    assert scores_of(world.platform, "in a tab")


def test_the_platforms_storage_where_frames_keep_no_cookies(world: World) -> None:
    of_learner(world, "stored", cookieless=True)
    with world.context() as context:
        page = context.new_page()
        frame = world.framed(page, storage="keeper")
        button = frame.get_by_role("button", name="Open in a new tab")
        expect(button).to_be_visible()
        assert page.title() == "lti.get_data lti.put_data Course"
        with context.expect_page() as opened:
            button.click()
        answer(opened.value)


def test_a_new_tab_where_nothing_is_kept_in_frames(world: World) -> None:
    of_learner(world, "alone", cookieless=True)
    with world.context() as context:
        page = context.new_page()
        link = world.framed(page).get_by_role("link", name="Open in a new tab")
        with context.expect_page() as opened:
            link.click()
        answer(opened.value)


def test_only_the_platform_may_show_a_session_in_a_frame(world: World) -> None:
    of_learner(world, "framed elsewhere")
    with world.context() as context:
        page = context.new_page()
        page.route("https://evil.test/", lambda route: route.fulfill(
            body=f'<iframe id="tool" src="{escape(world.login())}"></iframe>', content_type="text/html",
        ))  # fmt: skip
        page.goto("https://evil.test/")
        deadline = time.monotonic() + PATIENCE_MS / 1000
        while not page.frames[-1].url.startswith("chrome-error:"):
            assert time.monotonic() < deadline, page.frames[-1].url
            page.wait_for_timeout(50)


def test_an_instructor_chooses_in_a_frame(world: World) -> None:
    world.cookieless.on = False
    world.claims["make"] = lambda asked: (
        selection_claims(world.platform, asked)
        | {
            f"{CLAIM}roles": [INSTRUCTOR],
            f"{CLAIM}context": {"id": "context-1", "title": "Robotics"},
        }
    )
    with world.context() as context:
        page = context.new_page()
        frame = world.framed(page)
        quiz = frame.get_by_role("group", name="Knowledge check")
        quiz.get_by_label("The whole quiz").check()
        frame.get_by_role("button", name="Use what is chosen").click()
        expect(frame.get_by_role("heading", name="Taken")).to_be_visible()
        said = json.loads(frame.locator("pre").inner_text())
        [item] = said["https://purl.imsglobal.org/spec/lti-dl/claim/content_items"]
        assert item["lineItem"]["resourceId"] == item["custom"]["quiz"]
