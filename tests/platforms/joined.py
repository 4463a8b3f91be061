"""A grader and a platform that know each other, and a browser that goes between them."""

import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import httpx

from grader.courses.people import platforms as rules
from grader.courses.people.identity import COOKIE
from grader.settings import Settings
from grader.store import platforms
from grader.store.engine.database import Database
from platforms.platform import CLAIM, INSTRUCTOR, Claims, Platform, running_platform
from support.sites import Site, open_site, write_content


@dataclass
class Joined:
    """A site, a platform, and the course that the platform's context is linked with."""

    site: Site
    platform: Platform
    course: str = ""
    context: str = ""

    @property
    def database(self) -> Database:
        database: Database = self.site.app.state.services.database
        return database

    def new_course(self) -> "Joined":
        """The same with another course, whose context is linked already."""
        name = secrets.token_hex(4)
        other = replace(self, course=f"course-{name}", context=f"context-{name}")
        with self.database.write() as session:
            [row] = platforms.find_registered(session, self.platform.origin, self.platform.client_id)
            context = platforms.get_context(session, row.id, self.platform.deployment_id, other.context, "Robotics")
            session.flush()
            rules.link(session, None, context.id, other.course)
        return other

    def browser(self, **headers: str) -> httpx.Client:
        return self.site.anonymous(headers)

    def begin(self, browser: httpx.Client, **changes: str | None) -> dict[str, str]:
        """Begins a login; returns what the tool asks the platform for."""
        begun = browser.get("/lti/login", params=self.platform.login(self.site.origin, **changes))
        assert begun.status_code == 303, begun.text
        return self.platform.read_authentication_request(begun.headers["location"], self.site.origin)

    def claims(self, asked: dict[str, str], **changes: Any) -> Claims:
        context = {"id": self.context or "context-1", "title": "Robotics"}
        return self.platform.claims(asked, **{f"{CLAIM}context": context, **changes})

    def post(self, browser: httpx.Client, asked: dict[str, str], token: str, **more: str) -> httpx.Response:
        headers = {"Origin": self.platform.origin, "Sec-Fetch-Site": "cross-site"}
        return browser.post("/lti/launch", data={"state": asked["state"], "id_token": token, **more}, headers=headers)

    def launch(self, browser: httpx.Client, **changes: Any) -> httpx.Response:
        """The whole way of a right launch, with some claims changed."""
        asked = self.begin(browser)
        return self.post(browser, asked, self.platform.sign(self.claims(asked, **changes)))

    def teach(self, browser: httpx.Client, **changes: Any) -> httpx.Response:
        """As `launch`, by an instructor of the platform's course."""
        who = {"sub": "teacher-1", "name": "Tina Teach", f"{CLAIM}roles": [INSTRUCTOR]}
        return self.launch(browser, **{**who, **changes})


def signed_in(browser: httpx.Client) -> bool:
    return bool(browser.cookies.get(COOKIE))


@contextmanager
def joined_in(folder: Path, **changes: Any) -> Iterator[Joined]:
    """A grader in which a platform is registered and approved."""
    content = write_content(folder / "content")
    given = {"content": content, "data": folder / "data", "workers": 0, "private_hosts": ("127.0.0.1",), **changes}
    with running_platform() as platform, open_site(Settings(**given)) as site:
        joined = Joined(site, platform)
        with joined.database.write() as session:
            row = rules.add(session, None, platform.registration, platform.deployment_id)
            rules.approve(session, None, row.id)
        platform.tool_keys = site.anonymous().get("/lti/keys.json").json()
        yield joined
