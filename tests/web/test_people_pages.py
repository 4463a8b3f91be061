"""The page of people without JavaScript: links shown once, roles, tokens; what cannot be undone is asked first."""

import csv
import re
from collections.abc import Iterator

import pytest
from playwright.sync_api import Locator, Page, expect
from sqlalchemy.orm import Session

from grader.courses.people.identity import Role
from grader.courses.people.sign_in import create_sign_in_code
from grader.service.accounts import in_database
from grader.settings import Settings
from grader.store.tables import Member
from support.sites import Site, open_site, write_content
from web.browsing import Chromium

PEOPLE = "/instructor/people"
INVITE, TOKENS, AUDIT = (f"{PEOPLE}/{part}" for part in ("invitations", "tokens", "audit"))
expect.set_options(timeout=30_000)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    folder = tmp_path_factory.mktemp("people")
    content = write_content(folder / "content")
    with open_site(Settings(content=content, data=folder / "data", workers=0)) as site:
        yield site


@pytest.fixture(scope="module")
def desk(site: Site, browser: Chromium) -> Page:
    """An instructor's tab, at the page of people."""
    page = browser.new_context(base_url=site.origin, java_script_enabled=False).new_page()
    code = in_database(site.settings, lambda session: create_sign_in_code(session, "tina", Role.INSTRUCTOR))
    page.goto(f"/signin?code={code}")
    page.get_by_role("button", name="Sign in").click()
    page.goto(PEOPLE)
    return page


def asked(page: Page, row: str, name: str) -> None:
    """Presses a button of a row, and the one that it unfolds."""
    there = page.locator("tr").filter(has=page.get_by_role("rowheader", name=row, exact=True))
    asking = there.locator("details").filter(has=page.locator("summary", has_text=re.compile(f"^{name}")))
    button = asking.get_by_role("button")
    expect(button).to_be_hidden()
    asking.locator("summary").click()
    button.click()


def test_people_are_invited_promoted_and_removed_by_forms(site: Site, browser: Chromium, desk: Page) -> None:
    desk.goto(INVITE)
    desk.get_by_label("Names, one per line").fill("Ada\n\n Bob \nCem\nDee")
    desk.get_by_role("button", name="Make links").click()
    links = dict(line.split("\t") for line in desk.get_by_label("All links").input_value().splitlines())
    assert list(links) == ["Ada", "Bob", "Cem", "Dee"]
    with desk.expect_download() as saving:
        desk.get_by_role("link", name="Save them as CSV").click()
    with saving.value.path().open(newline="") as file:
        assert list(csv.reader(file)) == [["name", "link"], *map(list, links.items())]
    desk.goto(PEOPLE)
    assert links["Ada"] not in desk.content()  # shown once
    assert desk.locator("[data-list=members] th").all_inner_texts() == ["Ada", "Bob", "Cem", "Dee", "tina"]
    desk.goto(INVITE)
    assert links["Ada"] not in desk.content()
    asked(desk, "Bob", "Revoke")
    expect(desk.locator("[data-list=invitations] tr")).to_have_count(3)
    guest = browser.new_context(base_url=site.origin, java_script_enabled=False).new_page()
    guest.goto(links["Bob"])
    expect(guest.get_by_role("button", name="Sign in")).to_have_count(0)
    guest.goto(links["Ada"])
    guest.get_by_role("button", name="Sign in").click()
    expect(guest.locator(".top")).to_contain_text("Ada")

    desk.goto(PEOPLE)
    member = desk.locator("[data-list=members] tr").filter(has_text="Ada")
    change(member)
    member.get_by_role("button", name="New link for Ada").click()
    again = desk.get_by_label("Ada", exact=True).input_value()
    assert again != links["Ada"]
    desk.goto(PEOPLE)
    change(member)
    member.locator("summary", has_text="Make instructor").click()
    member.get_by_role("button", name="Make instructor of Ada").click()
    expect(member).to_contain_text("instructor")
    change(member)
    member.locator("summary", has_text="Remove").click()
    member.get_by_role("button", name="Remove from the course Ada").click()
    expect(member).to_have_count(0)
    done = "Ada is removed. To bring them back, with their answers and points, invite “Ada” as instructor again."
    expect(desk.locator(".notice[role=status]")).to_contain_text(done)
    desk.get_by_role("link", name="Their answers").click()
    expect(desk.locator(".page-head")).to_contain_text("removed from the course")
    expect(desk.locator(".page-head")).to_contain_text("invite “Ada” as instructor again")
    guest.goto("/instructor")
    expect(guest.locator(".top")).not_to_contain_text("Ada")
    desk.goto(AUDIT)
    expect(desk.locator("[data-list=audit]")).to_contain_text("member removed")


def change(row: Locator) -> None:
    """Unfolds what can be changed of a member."""
    row.locator("summary", has_text="Change").click()


def test_a_member_is_renamed_by_a_form(desk: Page) -> None:
    desk.goto(INVITE)
    desk.get_by_label("Names, one per line").fill("Eve")
    desk.get_by_role("button", name="Make links").click()
    for typed, shown, told in (("Evelyn", "Evelyn", "tina set this name"), ("", "Evelyn", "It stays, whatever")):
        desk.goto(PEOPLE)
        row = desk.locator("[data-list=members] tr").filter(has_text=re.compile("^Eve"))
        change(row)
        row.locator("summary", has_text="Rename").click()
        row.get_by_label("Name").fill(typed)
        row.get_by_role("button", name="Set the name").click()
        row = desk.locator("[data-list=members] tr").filter(has=desk.get_by_role("rowheader", name=shown))
        change(row)
        row.locator("summary", has_text="Rename").click()
        expect(row.get_by_text(told)).to_be_visible()
        expect(row.get_by_text("still find them as “Eve”, which stays their login")).to_be_visible()
        expect(desk.locator(".notice[role=status]")).to_contain_text("Evelyn is the name now.")


def test_what_is_refused_is_shown_with_what_was_typed(desk: Page) -> None:
    desk.goto(INVITE)
    for typed, told in (("Ann\nEve\nEve", "Given twice: Eve."), ("Ann\nEve\teve@example.org", r"Eve\teve@example.org")):
        desk.get_by_label("Names, one per line").fill(typed)
        desk.get_by_role("button", name="Make links").click()
        expect(desk.get_by_role("alert")).to_contain_text(told)
        expect(desk.get_by_label("Names, one per line")).to_have_value(typed)


def test_tokens_and_the_course_link_are_made_shown_and_ended_by_forms(site: Site, desk: Page) -> None:
    desk.goto(TOKENS)
    desk.get_by_text("Create a token").click()
    desk.get_by_label("User", exact=True).fill("nightly")
    desk.locator("#token-role").select_option("service")
    desk.get_by_label("Days until it ends").fill("7")
    desk.get_by_label("results").check()
    desk.get_by_role("button", name="Create").click()
    expect(desk.get_by_role("alert")).to_contain_text("The course has no user nightly")
    expect(desk.get_by_label("User", exact=True)).to_have_value("nightly")
    expect(desk.locator("[data-list=tokens]")).to_have_text("None.")
    desk.get_by_role("button", name="Create the user and the token").click()
    token = desk.get_by_label("nightly").input_value()
    headers = {"Authorization": f"Bearer {token}"}
    assert site.anonymous(headers).get("/api/v1/results").status_code == 200
    desk.goto(TOKENS)
    assert token not in desk.content()
    asked(desk, "nightly", "Revoke")
    expect(desk.locator("[data-list=tokens]")).to_have_text("None.")
    assert site.anonymous(headers).get("/api/v1/results").status_code == 401

    desk.goto(INVITE)
    desk.get_by_role("button", name="Make a course link").click()
    first = desk.get_by_label("Course link", exact=True).input_value()
    desk.locator("summary", has_text="Make a new link").click()
    desk.get_by_role("button", name="Replace the link").click()
    expect(desk.get_by_label("Course link", exact=True)).not_to_have_value(first)
    desk.locator("summary", has_text="Withdraw the link").click()
    desk.get_by_role("button", name="Withdraw it").click()
    expect(desk.locator("main")).to_contain_text("There is no link now")


def test_only_instructors_and_only_the_own_pages_change_people(site: Site, desk: Page) -> None:
    [cookie] = desk.context.cookies()
    paths = ("invitations", "link", "tokens", "members/" + "0" * 32)
    for path in paths:
        student = site.client("ann").post(f"{PEOPLE}/{path}", data={"names": "x"})
        forged = site.anonymous({"Cookie": f"{cookie['name']}={cookie['value']}", "Sec-Fetch-Site": "cross-site"})
        assert student.status_code in {401, 403}
        assert forged.post(f"{PEOPLE}/{path}", data={"names": "x"}).status_code == 403


def test_a_course_is_made_and_entered_by_forms(desk: Page) -> None:
    desk.goto("/instructor/courses")
    for name in ("welding", "robots"):
        desk.get_by_label("Name").fill(name)
        desk.get_by_role("button", name="Make the course").click()
        expect(desk).to_have_url(re.compile("/instructor/courses$"))
    desk.get_by_label("Name").fill("robots")
    desk.get_by_role("button", name="Make the course").click()
    expect(desk.get_by_role("alert")).to_contain_text("There is a course 'robots' already")
    expect(desk.get_by_label("Name")).to_have_value("robots")
    assert desk.locator("[data-list=taught] th").all_inner_texts() == ["default", "robots", "welding"]
    desk.get_by_role("button", name="Switch to robots").click()
    expect(desk.locator(".brand")).to_have_text("robots")
    expect(desk).to_have_url(re.compile("/instructor$"))
    desk.goto(INVITE)
    desk.get_by_label("Names, one per line").fill("mia")
    desk.get_by_label("Role").first.select_option("instructor")
    desk.get_by_role("button", name="Make links").click()
    link = desk.get_by_label("mia", exact=True).input_value()
    desk.goto("/instructor/courses")
    desk.get_by_role("button", name="Switch to welding").click()
    desk.goto(link)  # of somebody else, for a course of one's own: it may be added
    expect(desk.get_by_role("button", name="Sign in, and add it to my courses")).to_be_visible()
    desk.goto("/instructor/courses")
    desk.get_by_role("button", name="Switch to default").click()
    expect(desk.locator(".brand")).to_have_text("MuJoCo course")


def test_members_are_found_by_name_address_and_role_and_stay_in_sight_after_a_change(
    site: Site, browser: Chromium
) -> None:
    def fill(session: Session) -> None:
        many = [Member(course="fjord", name=f"Learner {n:04d}", role="student") for n in range(110)]
        many += [Member(course="fjord", name="Zoë Ødegård", role="student", email="z.o@fjord.example")]
        session.add_all(many)

    in_database(site.settings, fill)
    code = in_database(site.settings, lambda session: create_sign_in_code(session, "rita", Role.INSTRUCTOR, "fjord"))
    page = browser.new_context(base_url=site.origin, java_script_enabled=False).new_page()
    page.goto(f"/signin?code={code}")
    page.get_by_role("button", name="Sign in").click()
    page.goto(PEOPLE)
    names, status = page.locator("[data-list=members] th"), page.locator("p.meta[role=status]")
    expect(status).to_have_text("1 to 50 of 112 members")

    for typed, shown in (("ZOE", "Zoë Ødegård"), ("fjord.EXAMPLE", "Zoë Ødegård"), ("r 0107", "Learner 0107")):
        page.get_by_label("Name or e-mail address").fill(typed)
        page.get_by_role("button", name="Show", exact=True).click()
        expect(names).to_have_text([shown])
        expect(status).to_have_text("1 of 112 members")
        expect(page.get_by_text("z.o@fjord.example")).to_have_count(int(shown.startswith("Z")))
    change(page.locator("[data-list=members] tr"))
    page.get_by_role("button", name="New link for Learner 0107").click()
    expect(page.get_by_label("Learner 0107", exact=True)).to_be_visible()
    expect(names).to_have_text(["Learner 0107"])

    page.get_by_label("Name or e-mail address").fill("learner")
    page.get_by_role("button", name="Show", exact=True).click()
    for first, more in (("Learner 0000", "More"), ("Learner 0050", "More"), ("Learner 0100", "From the beginning")):
        expect(names.first).to_have_text(first)
        page.get_by_role("link", name=more).click()
    page.get_by_role("link", name="More").click()
    change(page.locator("[data-list=members] tr").first)
    page.locator("summary", has_text="Remove").first.click()
    page.get_by_role("button", name="Remove from the course Learner 0050").click()
    expect(names.first).to_have_text("Learner 0051")
    expect(status).to_have_text("51 to 100 of 109 of 111 members")

    page.get_by_role("link", name="Show all").click()
    page.get_by_label("Role").select_option("instructors")
    page.get_by_role("button", name="Show", exact=True).click()
    expect(names).to_have_text(["rita"])
    page.get_by_label("Name or e-mail address").fill("50%")
    page.get_by_role("button", name="Show", exact=True).click()
    expect(page.locator("[data-list=members]")).to_contain_text("Nobody among the instructors has “50%”")
    page.goto(f"{PEOPLE}?role=pirates&find=&start=900")
    expect(status).to_have_text("111 members")


def test_on_a_phone_a_remark_on_a_member_begins_a_line(site: Site, browser: Chromium) -> None:
    twins = [Member(course="twins", name=name, role="student", email="a@x.example") for name in ("Ann", "Anna")]
    in_database(site.settings, lambda session: session.add_all(twins))
    code = in_database(site.settings, lambda session: create_sign_in_code(session, "rita", Role.INSTRUCTOR, "twins"))
    phone = {"width": 390, "height": 800}
    page = browser.new_context(base_url=site.origin, java_script_enabled=False, viewport=phone).new_page()
    page.goto(f"/signin?code={code}")
    page.get_by_role("button", name="Sign in").click()
    page.goto(PEOPLE)
    cell = page.locator("td[data-column=From]").filter(has_text="Another member has a@x.example too").first
    remark = "Another member has a@x.example too: perhaps the same person"
    assert cell.inner_text().splitlines() == ["came without an invitation", remark]
