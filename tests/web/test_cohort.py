"""The class at one question: rights, names, no script, axe, narrow screens, keyboard; comments on lines, tried copies.
A class of the command `grader demo` is looked at, with the real judge behind it."""

import json
import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import httpx
import pytest
from playwright.sync_api import Page, expect
from sqlalchemy import delete, select
from sqlalchemy.orm import Session

from grader.courses.people.identity import Role
from grader.courses.people.sign_in import create_sign_in_code
from grader.service.accounts import in_database
from grader.service.demo import fill_demo
from grader.settings import Settings
from grader.store import submissions
from grader.store.engine.ids import make_id
from grader.store.reviewing.line_comments import LineComment, TriedCopy
from grader.store.tables import Member, Submission, VerdictRow, now
from web.browsing import LYING_ON_OTHERS, Chromium, findings, service

pytestmark = [pytest.mark.browser, pytest.mark.jail, pytest.mark.slow]
expect.set_options(timeout=30_000)

CLASS, STUDENTS = "/instructor/class/1.3-exercises/servo-threshold", "/quizzes/1.3-exercises/servo-threshold"
NARROW, WIDE = {"width": 390, "height": 844}, {"width": 1280, "height": 900}


@pytest.fixture(scope="module")
def settings(tmp_path_factory: pytest.TempPathFactory) -> Settings:
    settings = Settings(data=tmp_path_factory.mktemp("cohort"), workers=1)
    fill_demo(settings, print, learners=10, seed=6, now=now())
    return settings


@pytest.fixture(scope="module")
def origin(settings: Settings) -> Iterator[str]:
    with service(settings) as origin:
        yield origin


def enter(browser: Chromium, origin: str, settings: Settings, name: str, role: Role, *, scripts: bool = False) -> Page:
    page = browser.new_context(base_url=origin, java_script_enabled=scripts, viewport=WIDE).new_page()
    code = in_database(settings, lambda session: create_sign_in_code(session, name, role))
    page.goto(f"/signin?code={code}")
    page.get_by_role("button", name="Sign in").click()
    return page


@pytest.fixture(scope="module")
def desk(browser: Chromium, origin: str, settings: Settings) -> Page:
    """An instructor without JavaScript."""
    return enter(browser, origin, settings, "instructor", Role.INSTRUCTOR)


def find_learner(settings: Settings, *, has_solved: bool) -> tuple[str, str]:
    """A learner at the exercise by name, and their newest script."""
    here = (Submission.question == "servo-threshold", Submission.user != "instructor")  # whose copies are no answers
    wanted = select(Submission).where(*here).order_by(Submission.id.desc())

    def find(session: Session) -> tuple[str, str]:
        rows = session.scalars(wanted).all()
        solved = {row.learner for row in rows if row.outcome == "correct"}
        row = next(row for row in rows if (row.learner in solved) == has_solved)
        return row.user, row.id

    return in_database(settings, find)


def read_columns(settings: Settings, submission: str) -> dict[str, Any]:
    """The columns of a submission."""
    wanted = select(*Submission.__table__.columns).where(Submission.id == submission)
    return in_database(settings, lambda session: dict(session.execute(wanted).one()._mapping))


def list_names(settings: Settings) -> list[str]:
    return in_database(
        settings, lambda session: list(session.scalars(select(Member.name).where(Member.role == "student")))
    )


def test_every_dot_leads_to_its_answer_and_every_mistake_to_its_learners(desk: Page, settings: Settings) -> None:
    desk.goto(CLASS)
    solved = desk.locator(".facts dd").first.inner_text()
    assert " of " in solved
    dots = desk.locator(".wide-plot a")
    claims = in_database(
        settings,
        lambda session: len({
            row.learner for row, body in submissions.list_graded(
                session, submissions.SubmissionFilter("default", question="servo-threshold"), (), 1000
            ) if '"case":"lesson.Euler"' in body
        }),
    )  # fmt: skip
    assert dots.count() == claims > 4
    name = (dots.first.get_attribute("aria-label") or "").partition(":")[0]
    assert name in list_names(settings)
    dots.first.click()
    expect(desk.get_by_role("heading", level=1)).to_have_text(name)

    desk.goto(CLASS)
    family = desk.locator("details.family").first
    expect(family.locator(".family-count")).to_have_text(re.compile(r"^\d+ still, \d+ no longer$"))
    still, was = (int(part.split()[0]) for part in family.locator(".family-count").inner_text().split(","))
    family.locator("summary").click()
    assert family.locator(".people a").count() == still + was
    assert family.locator(".people").inner_text().count("still") == still
    family.get_by_role("link", name="Read").click()
    expect(desk.locator(".columns section")).to_have_count(min(still + was, 6))


def test_one_comment_reaches_all_who_still_make_a_mistake(desk: Page, settings: Settings) -> None:
    desk.goto(CLASS)
    family = next(one for one in desk.locator("details.family").all() if not one.inner_text().strip().startswith("0"))
    family.locator("summary").first.click()
    count = int(family.get_by_role("button").inner_text().split()[3])
    family.get_by_role("textbox").fill("Compare both ends <b>first</b>.")
    family.get_by_role("button").click()
    expect(desk.get_by_role("status")).to_contain_text(f"written to {count} script")
    kept = in_database(
        settings,
        lambda session: session.scalars(select(LineComment).where(LineComment.text.contains("Compare both"))).all(),
    )
    assert len({comment.submission_id for comment in kept}) == len(kept) == count


def test_no_count_is_of_mistakes_without_a_name(desk: Page) -> None:
    desk.goto("/instructor/class/1.3-exercises/servo-explain")
    expect(desk.get_by_text("Another mistake").first).to_be_attached()  # in the list
    assert "one mistake" not in desk.get_by_role("heading", level=1).inner_text()
    assert "“Another mistake.”" not in desk.locator("main").inner_text()
    desk.goto("/instructor/class/1.3-exercises/servo-explain/slides")
    assert "Another mistake" not in desk.locator("main").inner_text()


def test_the_statistics_lead_from_a_count_to_its_learners(desk: Page) -> None:
    desk.goto("/instructor/statistics?quiz=1.3-check")
    for link in [one.get_attribute("href") or "" for one in desk.locator(".counted a").all()]:
        desk.goto(link)
        anchor = link.partition("#")[2]
        assert desk.locator(f'[id="{anchor}"]').count() == 1, link


def test_statistics_fold_their_questions_the_hardest_first(desk: Page) -> None:
    desk.set_viewport_size(NARROW)  # type: ignore[arg-type]
    desk.goto("/instructor/statistics?quiz=1.3-exercises")
    assert desk.evaluate("document.documentElement.scrollHeight") < 2500
    assert desk.evaluate("document.documentElement.scrollWidth") == NARROW["width"]
    questions = desk.locator(".asked-question")
    shares = [
        int(text.split()[0].removesuffix("%")) for text in questions.locator("summary .counted").all_inner_texts()
    ]
    assert len(shares) > 2 and shares == sorted(shares)
    expect(questions.locator("table").first).to_be_hidden()
    question = questions.filter(has_text="The largest stable timestep")
    question.locator("summary").first.click()
    expect(question.locator("table").first).to_be_visible()
    count = question.locator(".counted a").first
    learners = int(count.inner_text().split()[0])
    count.click()
    expect(desk.locator("details.family[open] .people:target a")).to_have_count(learners)
    desk.set_viewport_size(WIDE)  # type: ignore[arg-type]


KINDS = {
    "threshold": ("1.3-exercises/servo-threshold?axis=lesson.Euler", "limit 19.98"),
    "rk4": ("1.3-exercises/rk4-step", "tolerance 10⁻¹⁰"),
    "order": ("1.3-exercises/rk4-step?axis=order", "right 4"),
    "numeric": ("1.3-check/q2", "right 5"),
}
"""The page of a class for each kind of axis, and what its limit is called."""


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_has_an_axis_on_which_nothing_lies_on_anything(desk: Page, kind: str) -> None:
    path, limit = KINDS[kind]
    for size, plot in ((WIDE, ".wide-plot"), (NARROW, ".narrow-plot")):
        desk.set_viewport_size(size)  # type: ignore[arg-type]
        desk.goto(f"/instructor/class/{path}")
        picture = desk.locator(plot)
        expect(picture.locator("text.name")).to_contain_text(limit)
        assert picture.locator("a .person").count() == desk.locator("figure tbody tr").count() > 0
        assert picture.evaluate(LYING_ON_OTHERS) == []
    desk.set_viewport_size(WIDE)  # type: ignore[arg-type]


def test_slides_name_nobody_and_are_a_page_each(desk: Page, settings: Settings) -> None:
    desk.goto(CLASS)
    desk.get_by_role("link", name="Open as slides").click()
    slides = desk.locator(".slide").count()
    assert slides >= 2
    shown = desk.locator("main").inner_text()
    assert not [name for name in list_names(settings) if name in shown]
    assert len(re.findall(rb"/Type /Page\b", desk.pdf(format="A4", landscape=True))) == slides


def test_slides_are_shown_on_the_full_screen_by_keys_and_by_buttons(
    browser: Chromium, origin: str, settings: Settings
) -> None:
    desk = enter(browser, origin, settings, "instructor", Role.INSTRUCTOR, scripts=True)
    desk.goto(f"{CLASS}/slides")
    slides, shown = desk.locator(".slide"), desk.locator(".slide:visible")
    count = slides.count()
    desk.get_by_role("button", name="Full screen").click()
    expect(desk.locator(".slides:fullscreen")).to_have_count(1)
    expect(shown).to_have_count(1)
    for key, place in (("ArrowRight", 1), ("ArrowLeft", 0), ("ArrowLeft", 0), ("PageDown", 1), ("PageUp", 0),
                       ("End", count - 1), ("ArrowRight", count - 1), ("Home", 0), (" ", 1)):  # fmt: skip
        desk.keyboard.press(key)
        expect(shown).to_have_attribute("id", f"slide-{place + 1}")
        expect(shown).to_be_focused()
    size = desk.viewport_size
    assert size is not None
    box = shown.bounding_box()
    assert box is not None
    assert box["width"] == size["width"]
    assert float(shown.evaluate("one => parseFloat(getComputedStyle(one).fontSize)")) > 20
    assert findings(desk) == []
    desk.get_by_role("button", name="Previous").click()
    expect(shown).to_have_attribute("id", "slide-1")
    desk.keyboard.press("Escape")
    expect(shown).to_have_count(count)
    expect(desk.locator(":fullscreen")).to_have_count(0)
    expect(desk.get_by_role("button", name="Full screen")).to_be_focused()

    desk.evaluate("() => { Element.prototype.requestFullscreen = () => Promise.reject(new TypeError()) }")
    desk.get_by_role("button", name="Full screen").click()
    expect(shown).to_have_count(1)
    desk.get_by_role("button", name="Leave").click()
    expect(shown).to_have_count(count)


def test_a_comment_stands_below_its_line_and_changes_no_points(
    desk: Page, browser: Chromium, origin: str, settings: Settings
) -> None:
    name, script = find_learner(settings, has_solved=False)
    desk.goto(f"/instructor/review/{script}?which=submissions")
    desk.evaluate("document.querySelectorAll('form').forEach(one => one.noValidate = true)")  # the browser asks first
    desk.get_by_role("spinbutton", name="Line;").fill("9999")
    desk.get_by_label("Comment, which").fill("Here.")
    desk.get_by_role("button", name="Write the comment").click()
    expect(desk.get_by_role("alert")).to_contain_text("has no line 9999")
    assert desk.get_by_label("Comment, which").input_value() == "Here."
    desk.get_by_role("spinbutton", name="Line;").fill("2")
    desk.get_by_label("Comment, which").fill("Two lines\n<b>of text</b>")
    desk.get_by_role("button", name="Write the comment").click()
    expect(desk.locator("tr:has(td:text-is('2')) + tr.commented")).to_contain_text("<b>of text</b>")

    page = enter(browser, origin, settings, name, Role.STUDENT)
    page.goto("/")
    page.get_by_role("link", name="1 comment", exact=True).click()
    expect(page.locator(".line-comments")).to_contain_text("Line 2: Two lines")
    expect(page.locator("#attempts").get_by_role("link").first).to_contain_text(", 1 comment")
    counted = in_database(
        settings,
        lambda session: len(session.scalars(select(VerdictRow).where(VerdictRow.submission_id == script)).all()),
    )
    assert counted == 1
    desk.goto(f"/instructor/review/{script}?which=submissions")
    for _ in range(desk.locator(".line-comment").count()):
        desk.locator(".line-comment").first.get_by_role("button", name="Delete").click()
    page.reload()
    expect(page.locator(".line-comments")).to_have_count(0)
    expect(page.locator("#attempts")).not_to_contain_text("comment")


def test_a_comment_on_an_earlier_attempt_is_told_where_the_learner_goes_on(
    desk: Page, browser: Chromium, origin: str, settings: Settings
) -> None:
    question = (Submission.quiz == "1.3-exercises", Submission.question == "servo-threshold", Submission.attempt == 1)
    tried = select(Submission.user).where(Submission.question == "servo-threshold", Submission.attempt > 1)
    first = select(Submission.id, Submission.user).where(*question, Submission.user.in_(tried)).limit(1)
    script, name = in_database(settings, lambda session: tuple(session.execute(first).one()))
    desk.goto(f"/instructor/review/{script}?which=submissions")
    desk.get_by_role("spinbutton", name="Line;").fill("1")
    desk.get_by_label("Comment, which").fill("Here it begins.")
    desk.get_by_role("button", name="Write the comment").click()

    page = enter(browser, origin, settings, name, Role.STUDENT)
    page.goto("/lessons/1.3")
    told = page.locator("article", has=page.locator("a[href$=servo-threshold]")).get_by_role(
        "link", name="A comment on"
    )
    expect(told).to_contain_text("A comment on your attempt of ")
    told.click()
    expect(page.locator(".line-comments")).to_contain_text("Here it begins.")
    expect(page.locator("#attempts [aria-current]")).to_contain_text("attempt 1")
    with fill_with_attempts(settings, script, 13):  # more than the page lists
        page.reload()
        expect(page.locator(".line-comments")).to_contain_text("Here it begins.")
    desk.locator(".line-comment").get_by_role("button", name="Delete").click()
    page.goto("/lessons/1.3")
    expect(told).to_have_count(0)


@contextmanager
def fill_with_attempts(settings: Settings, script: str, count: int) -> Iterator[None]:
    """The learner hands in the same script several times more."""
    ids = [make_id() for _ in range(count)]

    def insert(session: Session) -> None:
        row = session.execute(select(*Submission.__table__.columns).where(Submission.id == script)).one()
        columns = {name: value for name, value in row._asdict().items() if name != "idempotency_key"}
        session.add_all(Submission(**columns | {"id": one, "attempt": 100 + n}) for n, one in enumerate(ids))

    in_database(settings, insert)
    yield
    in_database(settings, lambda session: session.execute(delete(Submission).where(Submission.id.in_(ids))))


def test_a_changed_copy_is_judged_and_the_submission_stays(desk: Page, settings: Settings) -> None:
    _, script = find_learner(settings, has_solved=False)
    _, right = find_learner(settings, has_solved=True)
    before = read_columns(settings, script)
    desk.goto(f"/instructor/review/{right}/try")
    source = desk.get_by_label("Your copy").input_value()
    desk.goto(f"/instructor/review/{script}/try")
    desk.get_by_label("Your copy").fill(source)
    desk.get_by_role("button", name="Run it").click()
    expect(desk.locator(".verdict-head")).to_contain_text("attempt")
    assert read_columns(settings, script) == before
    copy = in_database(settings, lambda session: session.scalars(select(TriedCopy)).one())
    assert copy.original == script
    mine = in_database(settings, lambda session: session.get_one(Submission, copy.submission_id))
    assert (mine.user, mine.seed) == ("instructor", before["seed"])  # the same hidden cases
    response = desk.goto(f"/instructor/review/{right}/try?copy={copy.submission_id}")
    assert response is not None and response.status == 404  # a copy of another script
    desk.goto(CLASS)
    expect(desk.locator("main")).not_to_contain_text("instructor")  # no learner of the class


def test_a_learner_sees_the_class_once_solved_and_nobodys_name(
    browser: Chromium, origin: str, settings: Settings
) -> None:
    name, _ = find_learner(settings, has_solved=False)
    page = enter(browser, origin, settings, name, Role.STUDENT)
    page.goto(STUDENTS)
    expect(page.get_by_role("link", name="Where the class stands")).to_have_count(0)
    response = page.goto(f"{STUDENTS}/class")
    assert response is not None and response.status == 409

    name, _ = find_learner(settings, has_solved=True)
    page = enter(browser, origin, settings, name, Role.STUDENT)
    page.goto(f"{STUDENTS}/class")
    assert page.locator(".wide-plot .person").count() >= 8
    assert page.locator(".wide-plot .own").count() == 1
    assert page.locator("svg a, svg .move, svg title").count() == 0
    shown = page.content()
    assert not [other for other in list_names(settings) if other in shown and other != name]
    ids = in_database(settings, lambda session: list(session.scalars(select(Submission.id))))
    assert not [id_ for id_ in ids if id_ in shown]
    assert page.goto(f"{CLASS}").status == 403  # type: ignore[union-attr]


def test_too_few_learners_are_not_shown_to_each_other(browser: Chromium, origin: str, settings: Settings) -> None:
    name, _ = find_learner(settings, has_solved=True)
    page = enter(browser, origin, settings, name, Role.STUDENT)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("grader.web.cohort.learner_page.LEARNERS_MIN", 100)
        page.goto(f"{STUDENTS}/class")
    expect(page.get_by_role("heading", level=1)).to_have_text("Too few have answered yet")
    expect(page.locator("main")).to_contain_text(
        re.compile(r"once 100 learners have an answer that can be drawn, .* So far \d+ have one\.")
    )
    assert page.locator("svg.class-plot").count() == 0


def hand_in_alike(session: Session) -> tuple[str, str]:
    """Lets the newest scripts of two learners be one, but for names and numbers; returns the learners' names."""
    here = (Submission.question == "servo-threshold", Submission.user != "instructor")
    newest = {row.learner: row for row in session.scalars(select(Submission).where(*here).order_by(Submission.id))}
    one, other = sorted(newest.values(), key=lambda row: row.id)[-2:]
    one.answer = json.dumps({"source": UNUSUAL})
    other.answer = json.dumps({"source": UNUSUAL.replace("inertia", "j").replace("0.25", "1e-1")})
    return one.user, other.user


UNUSUAL = """
import numpy as np
def largest_stable_timestep(model, integrator):
    inertia = model.dof_M0[0]
    gains = np.array([model.actuator_gainprm[0, 0], -model.actuator_biasprm[0, 2]])
    matrix = np.array([[1, 2], [-gains[0] / inertia, 1 - gains[1] / inertia]])
    radius = max(abs(np.linalg.eigvals(matrix)))
    table = {h: radius * h for h in np.linspace(0.001, 0.05, 400) if np.isfinite(radius * h)}
    found = [h for h, value in sorted(table.items(), reverse=True) if value < 0.25 or np.isclose(value, 0.25)]
    return found[0] - 0.00025, found[0] + 0.00025
"""


def test_scripts_that_look_alike_are_for_instructors_alone(
    desk: Page, browser: Chromium, origin: str, settings: Settings
) -> None:
    names = in_database(settings, hand_in_alike)
    desk.goto("/instructor/alike?what=1.3-exercises/servo-threshold")
    row = desk.locator("tbody tr").filter(has_text=names[0]).filter(has_text=names[1])
    assert sorted(desk.locator("tbody a").all_inner_texts()) == sorted(set(desk.locator("tbody a").all_inner_texts()))
    row.get_by_role("link", name=names[0], exact=True).click()
    expect(desk.locator(".columns h2")).to_have_count(2)
    assert set(desk.locator(".columns h2").all_inner_texts()) == set(names)
    for side in desk.locator(".columns section").all():
        assert side.locator(".changed").count() >= 5
    assert desk.goto("/instructor/alike?one=1&other=2").status == 404  # type: ignore[union-attr]
    name, _ = find_learner(settings, has_solved=True)
    page = enter(browser, origin, settings, name, Role.STUDENT)
    assert page.goto("/instructor/alike").status == 403  # type: ignore[union-attr]


def test_a_long_story_is_one_line_a_question_and_opens_where_a_link_leads(desk: Page, settings: Settings) -> None:
    name, _ = find_learner(settings, has_solved=False)
    desk.goto("/instructor/gradebook")
    desk.get_by_role("link", name=name, exact=True).first.click()
    questions = desk.locator("details.asked-question")
    assert questions.count() > 6
    opened = desk.locator("details.asked-question[open]")
    assert opened.count() == opened.filter(has=desk.locator(".notice")).count() < 3  # what is under review is told
    desk.goto(f"{desk.url}#1.3-exercises--servo-threshold")
    expect(opened.filter(has_text="The largest stable timestep")).to_have_count(1)
    expect(desk.locator("[id='1.3-exercises--servo-threshold'] .story").first).to_be_visible()


def test_a_script_is_seen_before_its_question(desk: Page, settings: Settings) -> None:
    _, script = find_learner(settings, has_solved=False)
    desk.goto(f"/instructor/review/{script}")
    expect(desk.locator(".source-lines .number").first).to_be_in_viewport(ratio=1)
    question = desk.locator("details").filter(has_text="Write largest_stable_timestep")
    question.get_by_text("Question", exact=True).click()
    expect(question.locator(".prose")).to_be_visible()


def test_a_certified_key_is_one_line_until_it_is_opened(desk: Page) -> None:
    desk.goto("/instructor/certificates")
    row = desk.locator("tr").filter(has_text="1.3-check q2")
    expect(row.get_by_text("Simulated")).to_be_hidden()
    row.locator("summary").first.click()
    expect(row.get_by_text("Simulated")).to_be_visible()
    remarked = desk.locator("tr").filter(has_text="1.3-check q3")
    expect(remarked.get_by_text("Stable here too")).to_be_visible()


def test_what_is_set_is_saved_without_scrolling(desk: Page) -> None:
    desk.goto("/instructor/dates?quiz=1.3-exercises")
    expect(desk.get_by_role("button", name="Save")).to_be_in_viewport(ratio=1)
    desk.goto("/instructor/extensions?quiz=1.3-exercises")
    expect(desk.get_by_role("heading", name="Give single learners more time in 1.3-exercises")).to_be_visible()
    desk.get_by_role("link", name="Dates and rules").last.click()
    expect(desk.get_by_role("combobox", name="Quiz")).to_have_value("1.3-exercises")


def test_a_quiz_is_named_more_quietly_than_its_question(desk: Page) -> None:
    desk.goto("/instructor/review?which=submissions")
    row = desk.locator("[data-submissions] th").first
    weight = "it => getComputedStyle(it).fontWeight"
    assert row.locator(".meta").evaluate(weight) == "400"
    assert row.evaluate(weight) == "600"


def test_without_a_session_the_pages_ask_to_sign_in(origin: str) -> None:
    for path in (CLASS, f"{CLASS}/slides", f"{CLASS}/scripts?mistake=x", "/instructor/alike"):
        assert httpx.get(origin + path).status_code == 401


def test_no_page_has_a_fault_or_scrolls_sideways(browser: Chromium, origin: str, settings: Settings) -> None:
    page = enter(browser, origin, settings, "instructor", Role.INSTRUCTOR, scripts=True)
    _, script = find_learner(settings, has_solved=False)
    for path in (
        *(f"/instructor/class/{path}" for path, _ in KINDS.values()),
        f"{CLASS}?axis=lesson.discrete", f"{CLASS}/slides", "/instructor/class/1.3-check/q1",
        "/instructor/class/1.3-check/q4", "/instructor/people",
        "/instructor/alike",
        f"/instructor/review/{script}", f"/instructor/review/{script}/try", "/instructor/statistics?quiz=1.3-exercises",
    ):  # fmt: skip
        page.goto(path)
        for size in (WIDE, NARROW):
            page.set_viewport_size(size)  # type: ignore[arg-type]
            assert page.evaluate("document.documentElement.scrollWidth") == size["width"], (path, size)
            if path.startswith((CLASS, "/instructor/statistics")):
                page.evaluate("for (const one of document.querySelectorAll('details')) one.open = true")
            assert findings(page, contrast=size is WIDE) == [], (path, size)
    page.goto("/instructor/people")
    assert page.evaluate("document.documentElement.scrollHeight") < 150 * 18  # 17 people, none unfolded


SIGNS_ON_TEXT = """() => [...document.querySelectorAll('.mark > svg')].filter(sign => {
  const words = document.createRange();
  words.selectNodeContents(sign.parentElement);
  words.setStartAfter(sign);
  const [at, text] = [sign.getBoundingClientRect(), words.getBoundingClientRect()];
  return at.width && text.width && text.left < at.right - 1 && at.left < text.right - 1;
}).map(sign => sign.parentElement.textContent.trim())"""
"""The words on which their sign lies."""


def test_no_sign_lies_on_its_word(desk: Page) -> None:
    for path in ("/instructor/class/1.3-check/q1", "/instructor/statistics?quiz=1.3-check"):
        desk.goto(path)
        assert desk.locator(".mark > svg").count(), path
        assert desk.evaluate(SIGNS_ON_TEXT) == [], path


INSTRUCTORS = (
    "", "/stuck", "/service", "/review", "/review?which=submissions", "/gradebook", "/statistics", "/alike",
    "/regrades", "/extensions", "/content", "/draft", "/dates", "/certificates", "/people", "/people/invitations",
    "/people/tokens", "/people/audit", "/lti", "/courses",
)  # fmt: skip


def test_every_page_of_an_instructor_works_on_a_phone_without_a_script(desk: Page) -> None:
    desk.set_viewport_size(NARROW)  # type: ignore[arg-type]
    linked = set()
    for path in INSTRUCTORS:
        response = desk.goto(f"/instructor{path}")
        assert response is not None and response.status == 200, path
        assert desk.evaluate("document.documentElement.scrollWidth") == NARROW["width"], path
        expect(desk.get_by_role("heading", level=1)).to_be_visible()
        linked |= {one.get_attribute("href") for one in desk.locator("header.top nav a, nav.within a").all()}
    assert linked <= {f"/instructor{path}" for path in INSTRUCTORS}  # each page of the navigation is in the list
    desk.set_viewport_size(WIDE)  # type: ignore[arg-type]


def test_a_mistake_opens_and_a_dot_is_reached_by_keyboard(browser: Chromium, origin: str, settings: Settings) -> None:
    page = enter(browser, origin, settings, "instructor", Role.INSTRUCTOR, scripts=True)
    page.goto(CLASS)
    page.locator("details.family summary").first.focus()
    page.keyboard.press("Enter")
    expect(page.locator("details.family .people").first).to_be_visible()
    page.locator(".wide-plot a").first.focus()
    page.keyboard.press("Enter")
    page.wait_for_url("**/instructor/review/**")
