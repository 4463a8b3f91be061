"""Somebody who is invited gets in and hands in: a real browser, behind nginx with TLS and deploy/nginx.conf."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from ipaddress import ip_network

import pytest
from playwright.sync_api import Page, expect

from grader.courses.people.invitations import invite
from grader.service.accounts import in_database, sign_in_url
from grader.settings import Settings
from support.proxies import free_port, nginx
from web.browsing import Chromium, chromium, service

PATIENCE_MS = 30_000


@dataclass
class Public:
    """The service as the world sees it, and a browser."""

    settings: Settings
    browser: Chromium

    @contextmanager
    def person(self) -> Iterator[Page]:
        """A browser of its own, whose console stays quiet."""
        context = self.browser.new_context(base_url=self.settings.origin, ignore_https_errors=True)
        context.set_default_timeout(PATIENCE_MS)
        page, complaints = context.new_page(), list[str]()
        page.on("console", lambda message: complaints.append(message.text) if message.type != "log" else None)
        page.on("pageerror", lambda error: complaints.append(str(error)))
        yield page
        context.close()
        assert [
            complaint for complaint in complaints if "status of 401" not in complaint
        ] == []  # the page after signing out


@pytest.fixture(scope="module")
def public(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Public]:
    folder, port = tmp_path_factory.mktemp("public"), free_port()
    settings = Settings(
        data=folder / "data",
        workers=0,
        public_origin=f"https://localhost:{port}",
        trusted_proxies=(ip_network("127.0.0.1"),),
    )
    with service(settings) as upstream, nginx(folder, port, upstream), chromium() as browser:
        yield Public(settings, browser)


def answer(page: Page) -> None:
    """Answers one question."""
    card = page.locator('[id="1.3-check--q2"]')
    card.get_by_label("Your answer").fill("5 ms")
    card.get_by_role("button", name="Send").click()
    expect(card.locator("[data-status]")).to_have_text("Correct", timeout=PATIENCE_MS)


def open_people(desk: Page, part: str) -> None:
    """Opens a part of the pages of people."""
    desk.get_by_role("link", name="People").click()
    desk.get_by_role("link", name=part, exact=True).click()


def new_course_link(desk: Page) -> str:
    """Makes a new course link on the page of people, and returns it once it is shown."""
    if desk.get_by_role("button", name="Make a course link").count():
        desk.get_by_role("button", name="Make a course link").click()
    else:
        desk.locator("summary", has_text="Make a new link").click()
        desk.get_by_role("button", name="Replace the link").click()
    return desk.get_by_role("textbox", name="Course link").input_value()


def test_somebody_invited_from_the_command_line_gets_in_and_hands_in(public: Public) -> None:
    [made] = in_database(public.settings, lambda session: invite(session, None, None, ["Ada Lovelace"]))
    with public.person() as page:
        page.goto(f"{public.settings.origin}/signin?code={made.code}")
        expect(page.locator("main")).to_contain_text("Ada Lovelace")
        page.get_by_role("button", name="Sign in").click()
        answer(page)
        [cookie] = page.context.cookies()
        assert (cookie["name"], cookie["secure"], cookie["httpOnly"]) == ("__Host-grader_session", True, True)
        page.reload()
        expect(page.locator('[id="1.3-check--q2"] [data-status]')).to_have_text("Correct", timeout=PATIENCE_MS)


def test_an_instructor_invites_on_the_page_and_a_course_link_lets_others_in(public: Public) -> None:
    with public.person() as desk, public.person() as bob, public.person() as eve:
        desk.goto(sign_in_url(public.settings))
        desk.get_by_role("button", name="Sign in").click()
        open_people(desk, "Invite")
        desk.get_by_label("Names, one per line").fill("Bob\nTom")
        desk.get_by_role("button", name="Make links").click()
        link = desk.get_by_label("Bob", exact=True).input_value()
        expect(desk.locator("[data-list=invitations] tr")).to_have_count(2, timeout=PATIENCE_MS)

        bob.goto(link)
        bob.get_by_role("button", name="Sign in").click()
        answer(bob)

        course_link = new_course_link(desk)
        assert course_link.startswith(f"{public.settings.origin}/join?code=")
        eve.goto(course_link)
        eve.get_by_label("Your name").fill("Eve")
        eve.get_by_role("button", name="Join").click()
        answer(eve)

        open_people(desk, "Audit log")
        expect(desk.locator("[data-list=audit]")).to_contain_text("course link rotated")
        open_people(desk, "Members")
        expect(desk.locator("[data-list=members]")).to_contain_text("Eve")
        open_people(desk, "Invite")
        expect(desk.locator("[data-list=invitations] tr")).to_have_count(1, timeout=PATIENCE_MS)
        desk.locator("[data-list=invitations] summary").click()
        desk.get_by_role("button", name="Revoke the link of Tom").click()
        expect(desk.locator("[data-list=invitations]")).to_have_count(0, timeout=PATIENCE_MS)
        open_people(desk, "Audit log")
        expect(desk.locator("[data-list=audit]")).to_contain_text("invitation revoked")

        open_people(desk, "Tokens")
        desk.get_by_text("Create a token").click()
        desk.get_by_label("User", exact=True).fill("nightly")
        desk.get_by_label("Role").select_option("service")
        desk.get_by_label("results").check()
        desk.get_by_role("button", name="Create").click()
        desk.get_by_role("button", name="Create the user and the token").click()
        expect(desk.get_by_role("textbox", name="nightly")).to_have_value(re.compile("^grt_"), timeout=PATIENCE_MS)
        row = desk.locator("[data-list=tokens] tr").filter(has_text="nightly")
        expect(row).to_contain_text("results")
        row.locator("summary").click()
        row.get_by_role("button", name="Revoke the token").click()
        expect(row).to_have_count(0, timeout=PATIENCE_MS)


def test_a_learner_leaves_with_a_link_and_comes_back(public: Public) -> None:
    with public.person() as desk, public.person() as eve, public.person() as elsewhere:
        desk.goto(sign_in_url(public.settings))
        desk.get_by_role("button", name="Sign in").click()
        open_people(desk, "Invite")
        eve.goto(new_course_link(desk))
        eve.get_by_label("Your name").fill("Eve")
        eve.get_by_role("button", name="Join").click()
        answer(eve)
        eve.get_by_role("link", name="Sign out").click()
        expect(eve.locator("main")).to_contain_text("your answers are lost")
        eve.get_by_role("button", name="Make a link to come back").click()
        link = eve.get_by_label("Your link").input_value()
        eve.get_by_role("button", name="Sign out").click()
        elsewhere.goto(link)
        elsewhere.get_by_role("button", name="Sign in").click()
        expect(elsewhere.locator('[id="1.3-check--q2"] [data-status]')).to_have_text("Correct", timeout=PATIENCE_MS)
