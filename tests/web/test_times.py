"""Moments on pages: UTC from the server, the reader's zone with JavaScript; forms that say their zone."""

import re
from collections.abc import Iterator
from datetime import UTC, datetime

import pytest
from playwright.sync_api import Page, expect

from grader.courses.people.identity import Role
from grader.courses.people.sign_in import create_sign_in_code
from grader.errors import Unprocessable, WrongMoments
from grader.service.accounts import in_database
from grader.settings import Settings
from grader.web.text.moments import tag_clock, tag_moment, tag_moments
from grader.web.text.zones import convert_moments, find_zone, to_utc, write_moment
from support.sites import Site, open_site, write_content
from web.browsing import Chromium, findings

API = "/api/v1"
DUE = datetime(2190, 11, 27, 18, 0, tzinfo=UTC)
ZONES = [
    ("America/New_York", "27 Nov 2190, 13:00 EST", "2190-11-27T13:00"),
    ("Asia/Kolkata", "27 Nov 2190, 23:30 IST", "2190-11-27T23:30"),
    ("UTC", "27 Nov 2190, 18:00 UTC", "2190-11-27T18:00"),
]


def test_a_moment_is_utc_in_words_and_for_programs() -> None:
    template = '<time class="nowrap" datetime="2190-11-27T18:00:00+00:00" title="27 Nov 2190, 18:00 UTC">{}</time>'
    assert tag_moment(DUE) == template.format("27 Nov 2190, 18:00 UTC")
    assert tag_clock(DUE) == template.format("18:00 UTC")
    assert tag_moments("<b> Due on 27 Nov 2190, 18:00 UTC.") == (
        "&lt;b&gt; Due on " + template.format("27 Nov 2190, 18:00 UTC") + "."
    )
    assert tag_moments("over since Sat 27 Nov 2190, 18:00 UTC") == "over since " + template.format(
        "Sat 27 Nov 2190, 18:00 UTC"
    )
    assert tag_moments("31 Feb 2190, 18:00 UTC, 10 of 12") == "31 Feb 2190, 18:00 UTC, 10 of 12"


@pytest.mark.parametrize(
    ("text", "zone", "utc"),
    [
        ("2026-11-27T18:00", "Europe/Berlin", "2026-11-27T17:00"),
        ("2026-07-27T18:00", "Europe/Berlin", "2026-07-27T16:00"),
        ("2026-11-27T18:00", "America/New_York", "2026-11-27T23:00"),
        ("2026-11-27T18:00:30", "Asia/Kolkata", "2026-11-27T12:30:30"),
        ("2026-11-27T18:00", "Asia/Calcutta", "2026-11-27T12:30"),  # as Chromium names it
        ("2026-11-27T18:00", "", "2026-11-27T18:00"),
        ("2026-11-27T18:00", " utc ", "2026-11-27T18:00"),
        ("soon", "Europe/Berlin", "soon"),  # the policy refuses it, with its own sentence
        ("0001-01-01T00:00", "Asia/Kolkata", "0001-01-01T00:00"),
        ("", "Asia/Kolkata", ""),
    ],
)
def test_a_typed_moment_is_read_in_its_zone(text: str, zone: str, utc: str) -> None:
    assert to_utc(text, find_zone(zone)) == utc


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("2026-03-29T02:30", "02:30 on 29 Mar 2026 does not exist in Europe/Berlin: clocks are put forward."),
        ("2026-10-25T02:30", "as 25 Oct 2026, 00:30 UTC and as 25 Oct 2026, 01:30 UTC. Write UTC as the zone"),
    ],
)
def test_a_time_that_clocks_skip_or_repeat_is_refused_with_the_cure(text: str, why: str) -> None:
    with pytest.raises(Unprocessable, match=re.escape(why)):
        to_utc(text, find_zone("Europe/Berlin"))


@pytest.mark.parametrize("name", ["Europe/Berln", "../../etc/passwd", "/etc/localtime", "Europe", "\x00", "x" * 5000])
def test_a_name_that_is_no_zone_is_refused_with_the_cure(name: str) -> None:
    with pytest.raises(WrongMoments, match=r"^Zone: .* is no time zone\. Write a name such as Europe/Berlin"):
        convert_moments({"zone": name, "due": "2026-11-27T18:00"}, {"due": "Due"})


def test_without_a_database_of_zones_only_utc_is_read(monkeypatch: pytest.MonkeyPatch) -> None:
    def no_zone(name: str) -> None:
        raise FileNotFoundError(name)

    monkeypatch.setattr("zoneinfo.ZoneInfo", no_zone)
    monkeypatch.setattr("zoneinfo.available_timezones", set)
    assert find_zone("UTC") is UTC
    with pytest.raises(Unprocessable, match="no database of time zones: write UTC, or have Debian's package tzdata"):
        find_zone("Europe/Berlin")


def test_a_moment_that_was_not_changed_stays_whatever_the_zone_says() -> None:
    twice = datetime(2026, 10, 25, 1, 30, 20, tzinfo=UTC)  # 02:30:20 in Berlin, for the second time
    berlin = {"zone": "Europe/Berlin", "shown_zone": "Europe/Berlin"}
    unchanged = {**berlin, "due": write_moment(twice, find_zone("Europe/Berlin"))}
    assert convert_moments(unchanged, {"due": "Due"}, {"due": twice})["due"] == write_moment(twice)
    other = {"zone": "Asia/Kolkata", "shown_zone": "UTC", "due": write_moment(DUE)}
    assert convert_moments(other, {"due": "Due"}, {"due": DUE})["due"] == write_moment(DUE)
    changed = {**berlin, "due": "2190-11-27T18:00"}
    assert convert_moments(changed, {"due": "Due"}, {"due": DUE})["due"] == "2190-11-27T17:00"


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    folder = tmp_path_factory.mktemp("times")
    with open_site(Settings(content=write_content(folder / "content"), data=folder / "data", workers=0)) as site:
        yield site


def sign_in(site: Site, browser: Chromium, user: str, role: Role, **options: object) -> Page:
    """The page of a person in a browser of their own."""
    page = browser.new_context(base_url=site.origin, **options).new_page()
    code = in_database(site.settings, lambda session: create_sign_in_code(session, user, role))
    page.goto(f"/signin?code={code}")
    page.get_by_role("button", name="Sign in").click()
    return page


def set_due(site: Site, due: datetime) -> None:
    """Sets the due date of the quiz, and no other rule, for the course."""
    teacher = site.client("tina", "instructor")
    changed = teacher.put(f"{API}/quizzes/small/policy", json={"due": due.isoformat()}, headers={"If-Match": "*"})
    assert changed.status_code == 200, changed.text


def due_of(site: Site) -> str | None:
    due: str | None = site.client("ann").get(f"{API}/quizzes/small").json()["policy"]["due"]
    return due


@pytest.mark.parametrize(("zone", "text", "field"), ZONES)
def test_a_reader_sees_moments_in_their_own_zone(
    site: Site, browser: Chromium, zone: str, text: str, field: str
) -> None:
    set_due(site, DUE)
    page = sign_in(site, browser, f"learner of {zone}", Role.STUDENT, timezone_id=zone)
    page.goto("/")
    due = page.locator("#facts time")
    expect(due).to_have_text(f"Sat {text}")
    expect(due).to_have_attribute("title", "27 Nov 2190, 18:00 UTC")
    expect(page.locator("#small [data-dates] time")).to_have_text(text)  # once for all questions of the quiz
    expect(page.locator("#small--q2 form time")).to_have_count(0)
    page.locator("#small--q2").get_by_role("textbox").fill("5 ms")
    page.locator("#small--q2").get_by_role("button", name="Send").click()
    expect(page.locator("#small--q2 [data-said]")).to_contain_text("attempt 1")  # taken over by page.js
    expect(page.locator("#small [data-dates] time")).to_have_text(text)
    expect(due).to_have_text(f"Sat {text}")
    assert findings(page) == []
    page.context.close()


@pytest.mark.parametrize(("zone", "text", "field"), ZONES)
def test_a_form_shows_and_takes_the_zone_of_its_reader(
    site: Site, browser: Chromium, zone: str, text: str, field: str
) -> None:
    set_due(site, DUE)
    page = sign_in(site, browser, "tina", Role.INSTRUCTOR, timezone_id=zone)
    page.goto("/instructor/dates?quiz=small")
    due = page.get_by_label("Due", exact=True)
    expect(due).to_have_value(field)
    page.get_by_label("Attempts at each question").fill("7")
    page.get_by_role("button", name="Save").click()
    expect(page.get_by_role("status")).to_contain_text("Saved.")
    assert due_of(site) == "2190-11-27T18:00:00Z"
    typed_zone = page.get_by_label("Zone of these times").input_value()
    due.fill("2190-12-24T18:00")
    page.get_by_label("Zone of these times").fill("Europe/Berln")
    page.get_by_role("button", name="Save").click()
    expect(page.get_by_role("alert")).to_contain_text("Zone: 'Europe/Berln' is no time zone. Write a name such as")
    expect(due).to_have_value("2190-12-24T18:00")  # what was typed is not converted again
    page.get_by_label("Zone of these times").fill(typed_zone)
    page.get_by_role("button", name="Save").click()
    expect(page.get_by_role("status")).to_contain_text("Saved.")
    expect(due).to_have_value("2190-12-24T18:00")
    wanted = {"America/New_York": "2190-12-24T23:00:00Z", "Asia/Kolkata": "2190-12-24T12:30:00Z"}
    assert due_of(site) == wanted.get(zone, "2190-12-24T18:00:00Z")
    page.context.close()


def test_an_extension_is_given_in_the_zone_of_its_form(site: Site, browser: Chromium) -> None:
    set_due(site, DUE)
    sign_in(site, browser, "ann", Role.STUDENT).context.close()
    page = sign_in(site, browser, "tina", Role.INSTRUCTOR, timezone_id="Asia/Kolkata")
    page.goto("/instructor/extensions?quiz=small")
    page.get_by_label("ann", exact=True).check()
    page.get_by_label("Due", exact=True).fill("2190-12-24T18:00")
    page.get_by_role("button", name="Give").click()
    expect(page.get_by_role("status")).to_have_text("ann: due Fri 24 Dec 2190, 18:00 IST")
    given = site.client("tina", "instructor").get(f"{API}/quizzes/small/extensions").json()["items"]
    assert [one["due"] for one in given] == ["2190-12-24T12:30:00Z"]
    page.context.close()


def test_a_form_without_times_leaves_the_scripts_of_its_page_alone(site: Site, browser: Chromium) -> None:
    teacher = site.client("tina", "instructor")
    teacher.put(f"{API}/quizzes/small/policy", json={"attempts": 3}, headers={"If-Match": "*"})
    sign_in(site, browser, "ann", Role.STUDENT).context.close()
    page, errors = sign_in(site, browser, "tina", Role.INSTRUCTOR), list[str]()
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.goto("/instructor/extensions?quiz=small")
    expect(page.get_by_label("Further attempts")).to_be_visible()
    assert errors == []
    page.context.close()


def test_without_javascript_forms_take_a_zone_and_pages_say_utc(site: Site, browser: Chromium) -> None:
    set_due(site, DUE)
    page = sign_in(site, browser, "tina", Role.INSTRUCTOR, timezone_id="Asia/Kolkata", java_script_enabled=False)
    page.goto("/instructor/dates?quiz=small")
    due = page.get_by_label("Due", exact=True)
    expect(due).to_have_value("2190-11-27T18:00")
    expect(page.get_by_role("cell", name="Sat 27 Nov 2190, 18:00 UTC")).to_be_visible()
    due.fill("2190-12-24T18:00")
    page.get_by_label("Zone of these times").fill("Europe/Berlin")
    page.get_by_role("button", name="Save").click()
    expect(page.get_by_role("status")).to_contain_text("Saved.")
    expect(due).to_have_value("2190-12-24T17:00")
    assert due_of(site) == "2190-12-24T17:00:00Z"
    page.context.close()
