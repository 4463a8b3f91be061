"""A learner's way with JavaScript: nothing typed is lost, and verdicts arrive by themselves."""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from playwright.sync_api import BrowserContext, FilePayload, Locator, Page, Route, expect

from grader.courses.answering.stopping import STOPPED_RUNNING
from web.browsing import Chromium, service, settings_in

REFERENCES = Path(__file__).parents[2] / "reference_solutions" / "1.3-exercises"
PATIENCE_MS = 30_000
"""A busy machine is slow, not wrong: how long anything on the page may take to appear."""

expect.set_options(timeout=PATIENCE_MS)

SERVO = "/quizzes/1.3-exercises/servo-threshold"
EXPECTED_NOISE = re.compile(r"status of (401|422)|ERR_INTERNET_DISCONNECTED")
"""What the browser itself logs of a refused or an offline request."""


@dataclass
class Visit:
    """One browser's tab, and whatever its console complained of."""

    context: BrowserContext
    page: Page
    complaints: list[str] = field(default_factory=list)

    def card(self, quiz: str, question: str) -> Locator:
        """One question."""
        return self.page.locator(f'[id="{quiz}--{question}"]')

    def status(self, quiz: str, question: str) -> Locator:
        """The verdict's status in words."""
        return self.card(quiz, question).locator("[data-status]")

    def hand_in(self, folder: str, name: str, more: str = "") -> None:
        """Loads a script into the editor, with `more` at its end, and hands it in."""
        text = f"{(REFERENCES / folder / name).read_text()}{more}"
        file: FilePayload = {"name": name, "mimeType": "text/x-python", "buffer": text.encode()}
        self.page.locator("[data-file]").set_input_files(file)
        expect(self.page.locator("[data-trouble]")).to_contain_text("is loaded")
        self.page.get_by_role("button", name="Run and judge").click()


def listened(context: BrowserContext) -> Visit:
    """A new tab whose console is kept."""
    visit = Visit(context, context.new_page())
    visit.page.on("console", lambda message: visit.complaints.append(message.text) if message.type != "log" else None)
    visit.page.on("pageerror", lambda error: visit.complaints.append(str(error)))
    return visit


@pytest.fixture(scope="module")
def origin(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    with service(settings_in(tmp_path_factory.mktemp("data"))) as origin:
        yield origin


@pytest.fixture
def visit(origin: str, browser: Chromium) -> Iterator[Visit]:
    """A new learner at the lesson; the console must stay quiet."""
    context = browser.new_context(base_url=origin, viewport={"width": 1280, "height": 800})
    visit = listened(context)
    visit.page.goto("/")
    yield visit
    context.close()
    assert [complaint for complaint in visit.complaints if not EXPECTED_NOISE.search(complaint)] == []


def test_tex_is_shown_as_mathematics(visit: Visit) -> None:
    expect(visit.page.locator("math msqrt").first).to_be_visible()
    assert "$" not in visit.page.locator("main").inner_text()


def test_a_number_is_echoed_sent_and_judged(visit: Visit) -> None:
    card = visit.card("1.3-check", "q2")
    card.get_by_label("Your answer").fill("-0.002 s")
    expect(card.locator("[data-trouble]")).to_have_text("read as −2 ms")
    card.get_by_label("Your answer").fill("0.005 s")
    expect(card.locator("[data-trouble]")).to_have_text("read as 5 ms")
    card.get_by_role("button", name="Send").click()
    expect(visit.status("1.3-check", "q2")).to_have_text("Correct")
    expect(card.locator(".explanation math").first).to_be_visible()
    expect(visit.page.locator("#facts")).to_contain_text("1 of 16")
    expect(visit.page.locator("#rail a").nth(1)).to_contain_text("1\u202f/\u202f1")


def test_what_cannot_be_read_says_why_before_it_is_sent_and_touches_nothing(visit: Visit) -> None:
    card = visit.card("1.3-check", "q2")
    card.get_by_label("Your answer").fill("5 kg")
    expect(card.locator("[data-trouble].bad")).to_contain_text("kg")
    card.get_by_role("button", name="Send").click()
    expect(card.locator("[data-trouble].bad")).to_contain_text("No attempt was used")
    assert card.get_by_label("Your answer").input_value() == "5 kg"
    expect(visit.status("1.3-check", "q2")).to_have_count(0)


def test_a_choice_is_made_with_the_keyboard_alone(visit: Visit) -> None:
    card = visit.card("1.3-check", "q1")
    card.get_by_role("radio").first.focus()
    visit.page.keyboard.press("ArrowDown")
    visit.page.keyboard.press("Enter")
    expect(visit.status("1.3-check", "q1")).to_have_text("Correct")
    expect(card.locator("[data-said]")).to_be_focused()


def test_the_same_answer_again_uses_no_attempt_and_the_best_one_is_told(visit: Visit) -> None:
    card, rail = visit.card("1.3-check", "q2"), visit.page.locator("#rail a").nth(1)
    field, said, trouble = (card.locator(one) for one in ("input[type=text]", "[data-said]", "[data-trouble].bad"))
    field.fill("5 ms")
    card.get_by_role("button").click()
    expect(said).to_contain_text("attempt 1")
    card.get_by_role("button", name="Send again").click()
    expect(trouble).to_have_text("This is what you sent last time. Change it first. No attempt was used.")
    field.fill("7 ms")
    expect(said).to_have_class(re.compile("is-old"))
    card.get_by_role("button").click()
    expect(said).to_contain_text("attempt 2")
    expect(said).to_contain_text("An earlier attempt counts: 1 of 1.")
    expect(said).not_to_have_class(re.compile("is-old"))
    expect(rail).to_contain_text("Correct")


@pytest.mark.parametrize("question", ["q2", "q4"])
def test_a_verdict_that_arrives_while_one_types_leaves_the_caret_where_it_is(visit: Visit, question: str) -> None:
    card, typed = visit.card("1.3-check", "q2"), visit.card("1.3-check", question)
    travelling: list[Route] = []

    def hold(route: Route) -> None:
        travelling.append(route)

    visit.page.route("**/quizzes/1.3-check/q2", hold)
    card.get_by_role("textbox").fill("7 ms")
    with visit.page.expect_request("**/quizzes/1.3-check/q2"):
        card.get_by_role("button").click()
    typed.get_by_role("textbox").fill("0.")
    travelling.pop().continue_()
    expect(card.locator("[data-said]")).to_contain_text("7 ms is too high")
    visit.page.keyboard.type("005 s")
    expect(typed.get_by_role("textbox")).to_have_value("0.005 s")
    expect(typed.get_by_role("textbox")).to_be_focused()


def test_how_a_number_is_read_does_not_replace_that_it_is_being_sent(visit: Visit) -> None:
    card, travelling = visit.card("1.3-check", "q2"), dict[str, Route]()

    def hold(route: Route) -> None:
        travelling[route.request.url.rpartition("/")[2]] = route

    visit.page.route(re.compile(r"/quizzes/1\.3-check/q2$|/answers:validate$"), hold)
    with visit.page.expect_request("**/answers:validate"):
        card.get_by_role("textbox").fill("7 ms")
    card.get_by_role("button").click()
    expect(card.locator("[data-trouble]")).to_have_text("Sending…")
    with visit.page.expect_response("**/answers:validate"):
        travelling["answers:validate"].continue_()
    visit.page.evaluate("new Promise(done => setTimeout(done, 100))")
    expect(card.locator("[data-trouble]")).to_have_text("Sending…")
    travelling["q2"].continue_()
    expect(card.locator("[data-said]")).to_contain_text("7 ms is too high")


def test_an_answer_that_waits_for_a_person_is_no_lost_point(visit: Visit) -> None:
    visit.card("1.3-check", "q4").get_by_role("textbox").fill("I would halve the step.")
    visit.card("1.3-check", "q4").get_by_role("button").click()
    expect(visit.page.locator("#facts div", has_text="with an instructor")).to_contain_text("1 point")
    expect(visit.page.locator("#rail a").nth(3)).to_contain_text("waits\u202f/\u202f1")


def test_no_choice_is_told_in_a_sentence(visit: Visit) -> None:
    card = visit.card("1.3-check", "q1")
    card.get_by_role("button", name="Send").click()
    expect(card.locator("[data-trouble]")).to_contain_text("Choose one of the options first.")


def test_everything_comes_back_after_a_reload(visit: Visit) -> None:
    visit.card("1.3-check", "q1").get_by_label("Integration").check()
    visit.card("1.3-check", "q1").get_by_role("button").click()
    expect(visit.status("1.3-check", "q1")).to_have_text("Not correct")
    visit.card("1.3-check", "q4").get_by_role("textbox").fill("Not sent <b>yet</b>.")
    visit.card("1.3-check", "q3").get_by_label("discrete").check()
    visit.page.reload()
    expect(visit.status("1.3-check", "q1")).to_have_text("Not correct")
    expect(visit.card("1.3-check", "q1").get_by_label("Integration")).to_be_checked()
    expect(visit.card("1.3-check", "q4").get_by_role("textbox")).to_have_value("Not sent <b>yet</b>.")
    expect(visit.card("1.3-check", "q4")).to_contain_text("not sent yet")
    expect(visit.card("1.3-check", "q3").get_by_label("discrete")).to_be_checked()


def test_a_draft_from_before_the_session_is_the_learners(visit: Visit) -> None:
    visit.card("1.3-check", "q4").get_by_role("textbox").fill("Before the first answer.")
    visit.card("1.3-check", "q1").get_by_label("Position stage").check()
    visit.card("1.3-check", "q1").get_by_role("button").click()
    expect(visit.status("1.3-check", "q1")).to_have_text("Correct")
    expect(visit.card("1.3-check", "q4").get_by_role("textbox")).to_have_value("Before the first answer.")


def begin(visit: Visit) -> None:
    """Gives the first answer, with which the session begins."""
    visit.card("1.3-check", "q1").get_by_label("Position stage").check()
    visit.card("1.3-check", "q1").get_by_role("button").click()
    expect(visit.status("1.3-check", "q1")).to_have_text("Correct")


def test_an_echo_and_the_first_answer_begin_one_session(visit: Visit) -> None:
    page = visit.page
    held: list[Route] = []

    def hold(route: Route) -> None:
        held.append(route)

    page.route("**/session", hold)
    card = visit.card("1.3-check", "q2")
    with page.expect_request("**/session"):  # the echo asks for a session
        card.get_by_label("Your answer").fill("5 ms")
    card.get_by_role("button").click()
    page.wait_for_timeout(300)
    [echo] = held
    echo.continue_()
    expect(visit.status("1.3-check", "q2")).to_have_text("Correct")
    visit.card("1.3-check", "q1").get_by_label("Position stage").check()
    visit.card("1.3-check", "q1").get_by_role("button").click()
    expect(visit.status("1.3-check", "q1")).to_have_text("Correct")
    expect(page.locator("#facts")).to_contain_text("2 of 16")


def test_two_tabs_show_one_draft_and_one_verdict(visit: Visit) -> None:
    begin(visit)
    other = listened(visit.context)
    other.page.goto("/")
    visit.card("1.3-check", "q4").get_by_role("textbox").fill("Typed in the first tab.")
    expect(other.card("1.3-check", "q4").get_by_role("textbox")).to_have_value("Typed in the first tab.")
    visit.card("1.3-check", "q2").get_by_label("Your answer").fill("5 ms")
    visit.card("1.3-check", "q2").get_by_role("button").click()
    expect(other.status("1.3-check", "q2")).to_have_text("Correct")
    assert other.complaints == []


def test_what_two_tabs_type_into_one_question_is_there_in_both_after_a_reload(visit: Visit) -> None:
    begin(visit)
    other = listened(visit.context)
    other.page.goto("/")
    one, two = (tab.card("1.3-check", "q4") for tab in (visit, other))
    one.get_by_role("textbox").fill("Typed in the first tab.")
    expect(two.get_by_role("textbox")).to_have_value("Typed in the first tab.")
    two.get_by_role("textbox").fill("Typed in the second tab.")
    expect(one.locator("[data-draft]")).to_contain_text("There is another draft.")
    one.get_by_role("textbox").fill("Typed in the first tab again.")
    two.get_by_role("textbox").fill("And in the second.")
    expect(one.locator("[data-draft]")).to_contain_text("There is another draft.")
    expect(one.get_by_role("textbox")).to_have_value("Typed in the first tab again.")
    visit.page.reload()
    expect(one.get_by_role("textbox")).to_have_value("Typed in the first tab again.")
    one.get_by_role("button", name="Show it").click()
    expect(one.get_by_role("textbox")).to_have_value("And in the second.")
    assert other.complaints == []


def test_an_exercise_shows_the_script_that_was_handed_in_and_not_another_tabs(visit: Visit) -> None:
    visit.page.goto(SERVO)
    other = listened(visit.context)
    other.page.goto(SERVO)
    code = [tab.page.locator("textarea.code") for tab in (visit, other)]
    code[1].fill("# of the second tab\n")
    expect(code[0]).to_have_value("# of the second tab\n")
    code[0].fill("# handed in\n")
    visit.page.get_by_role("button", name="Run and judge").click()
    expect(visit.page.locator("#result [data-status]")).to_be_visible()
    expect(other.page.locator("#result [data-status]")).to_be_visible()
    expect(code[0]).to_have_value("# handed in\n")
    visit.page.reload()
    expect(code[0]).to_have_value("# handed in\n")
    assert other.complaints == []


def test_offline_nothing_typed_is_lost(visit: Visit) -> None:
    begin(visit)
    card = visit.card("1.3-check", "q4")
    card.get_by_role("textbox").fill("Written in a tunnel.")
    visit.context.set_offline(True)
    card.get_by_role("button").click()
    expect(card.locator("[data-trouble].bad")).to_contain_text("cannot be reached")
    number = visit.card("1.3-check", "q2")
    number.get_by_role("textbox").fill("5 ms")
    number.get_by_role("button").click()
    expect(number.locator("[data-trouble].bad")).to_contain_text("cannot be reached")
    expect(number.locator("[aria-invalid=true]")).to_have_count(0)  # the connection failed, not the number
    visit.context.set_offline(False)
    visit.page.reload()
    expect(card.get_by_role("textbox")).to_have_value("Written in a tunnel.")
    card.get_by_role("button").click()
    expect(visit.status("1.3-check", "q4")).to_contain_text("instructor")


def test_a_session_that_ends_in_the_middle_of_an_answer_loses_nothing(visit: Visit) -> None:
    begin(visit)
    card = visit.card("1.3-check", "q4")
    card.get_by_role("textbox").fill("Half a sentence")
    visit.context.clear_cookies()
    card.get_by_role("button").click()
    expect(card.locator("[data-trouble].bad")).to_contain_text("session of this browser has ended. Load the page")
    expect(card.get_by_role("textbox")).to_have_value("Half a sentence")


def test_after_the_end_of_a_session_a_reload_offers_the_drafts_of_before(visit: Visit) -> None:
    begin(visit)
    text = visit.card("1.3-check", "q4").get_by_role("textbox")
    text.fill("Half a sentence")
    visit.page.goto(SERVO)
    visit.page.locator(".code-editor").wait_for()  # as it opens, Chromium would style what is put over a selection
    visit.page.locator("textarea.code").fill("# half a script")
    visit.context.clear_cookies()
    visit.page.reload()
    expect(visit.page.locator("[data-draft]")).to_contain_text(
        "Your session has ended; a draft is kept in this browser."
    )
    expect(visit.page.locator("textarea.code")).not_to_have_value(
        "# half a script"
    )  # the starter, until it is asked for
    visit.page.get_by_role("button", name="Show it").click()
    expect(visit.page.locator("textarea.code")).to_have_value("# half a script")
    visit.page.goto("/")
    expect(text).to_have_value("")
    visit.card("1.3-check", "q4").get_by_role("button", name="Show it").click()
    expect(text).to_have_value("Half a sentence")
    expect(visit.card("1.3-check", "q2").locator("[data-draft]")).to_have_count(0)


def test_a_script_is_judged_while_the_page_watches(visit: Visit) -> None:
    visit.page.goto(SERVO)
    mark = "# right-to-left: \u202e\n"  # goes back into the editor as it was
    visit.hand_in("servo-threshold", "crashed__no_such_function.py", mark)
    status = visit.page.locator("#result [data-status]")
    expect(status).to_have_text("Ended with an error")
    visit.hand_in("servo-threshold", "partial__constants.py")
    expect(status).to_have_text("Partly correct")
    expect(visit.page.locator("#attempts .chip")).to_have_count(2)
    expect(visit.page.locator(".diagnosis")).not_to_be_empty()
    assert visit.page.get_by_role("columnheader").filter(has_text="implicitfast").count() >= 1
    expect(visit.page.locator("svg.wide-plot").first).to_be_visible()
    expect(visit.page.locator("#announce")).to_contain_text("Partly correct")
    height = visit.page.locator("#result .verdict").bounding_box()
    assert height is not None
    assert height["height"] <= 600
    with visit.page.expect_download() as download:
        visit.page.get_by_role("link", name="Download (SVG)").first.click()
    assert download.value.suggested_filename.endswith(".svg")
    visit.page.locator("textarea.code").fill("# not sent")
    visit.page.locator("#attempts .chip").last.click()
    expect(visit.page.locator("#result [data-status]")).to_have_text("Ended with an error")
    expect(visit.page.locator("textarea.code")).to_have_value("# not sent")
    visit.page.get_by_text("The script of attempt 1").click()
    visit.page.get_by_role("button", name="Put it into the editor").click()
    crashed = (REFERENCES / "servo-threshold" / "crashed__no_such_function.py").read_text()
    expect(visit.page.locator("textarea.code")).to_have_value(f"{crashed}{mark}")
    visit.page.get_by_role("link", name="compare").click()
    expect(visit.page.get_by_role("heading", name="Two attempts side by side")).to_be_visible()
    expect(visit.page.locator(".side-by-side section")).to_have_count(2)
    visit.page.goto("/")
    expect(visit.page.locator("#rail")).to_contain_text("Partly correct")


EVENTS = """window.sources = []; window.parsed = 0;
  window.EventSource = class { constructor() { window.sources.push(this); this.on = {}; }
    addEventListener(name, told) { this.on[name] = told; } close() { } };
  const parse = DOMParser.prototype.parseFromString;
  DOMParser.prototype.parseFromString = function (...all) { window.parsed += 1; return parse.apply(this, all); };"""
"""Events that only the test sends; and the number of pages that have arrived."""


def test_a_page_that_was_asked_for_earlier_and_comes_later_is_dropped(visit: Visit) -> None:
    visit.context.add_init_script(EVENTS)
    visit.page.goto(SERVO)
    visit.hand_in("servo-threshold", "crashed__no_such_function.py")
    expect(visit.page.locator("#under-way .steps")).to_be_visible()
    before = visit.page.request.get(SERVO).text()
    while "data-events=" in (after := visit.page.request.get(SERVO).text()):
        visit.page.wait_for_timeout(100)
    asked: list[Route] = []

    def hold(route: Route) -> None:
        asked.append(route)

    visit.page.route(f"**{SERVO}", hold)
    for _ in range(2):
        visit.page.evaluate("window.sources.at(-1).on.graded()")
    while len(asked) < 2:
        visit.page.wait_for_timeout(20)
    early, late = asked
    late.fulfill(body=after, content_type="text/html")
    expect(visit.page.locator("#result [data-status]")).to_have_text("Ended with an error")
    parsed = visit.page.evaluate("window.parsed")
    early.fulfill(body=before.replace('id="result"', 'id="result" data-old'), content_type="text/html")
    visit.page.wait_for_function("parsed => window.parsed > parsed", arg=parsed)
    expect(visit.page.locator("#result[data-old]")).to_have_count(0)
    expect(visit.page.locator("#under-way[data-events]")).to_have_count(0)
    visit.page.unroute(f"**{SERVO}")


NUMBERS = "document.querySelector('[data-gutter]').textContent.split('\\n').length"


@pytest.mark.parametrize("with_editor", [True, False])
def test_the_lines_of_the_code_are_numbered_and_a_named_one_is_found(visit: Visit, *, with_editor: bool) -> None:
    if not with_editor:
        visit.page.route("**/vendor/*", lambda route: route.fulfill(content_type="text/javascript", body=""))
    visit.page.goto(SERVO)
    if with_editor:
        visit.page.locator(".code-editor").wait_for()
    code, gutter = visit.page.locator("textarea.code"), visit.page.locator("[data-gutter]")
    code.fill("\n" * 59 + "x = 1\nraise ValueError('no')\n" + "\n" * 60)
    assert visit.page.evaluate(NUMBERS) == 122
    code.evaluate("area => { area.scrollTop = 200 }")
    expect(gutter).to_have_js_property("scrollTop", 200)
    visit.page.get_by_role("button", name="Run and judge").click()
    visit.page.get_by_role("link", name="line 61").click()
    if with_editor:
        expect(visit.page.get_by_role("textbox", name="code")).to_be_focused()
        visit.page.keyboard.press("End")
        visit.page.keyboard.type("#")
        expect(code).to_have_value(re.compile(r"ValueError\('no'\)#"))
        return
    assert code.evaluate("area => area.value.slice(area.selectionStart).split('\\n')[0]") == "raise ValueError('no')"
    expect(code).to_be_focused()
    top = gutter.evaluate("one => one.scrollTop")
    assert code.evaluate("area => area.scrollTop") == top
    assert 0 < 60 * 21 - top < 200  # the line is in sight
    code.press("Control+A")
    code.press("Delete")
    assert visit.page.evaluate(NUMBERS) == 1


def test_the_old_verdict_stands_back_while_a_script_runs(visit: Visit) -> None:
    visit.page.goto(SERVO)
    visit.hand_in("servo-threshold", "crashed__no_such_function.py")
    expect(visit.page.locator("#result [data-status]")).to_be_visible()
    slow = "import time\ntime.sleep(4)\nprint('<b>not bold</b>')\n"
    slow += "def largest_stable_timestep(model, integrator):\n    return None\n"
    visit.page.locator("textarea.code").fill(slow)
    visit.page.keyboard.press("Control+Enter")
    expect(visit.page.locator("#result.is-old [data-status]")).to_have_text("Ended with an error")
    expect(visit.page.locator("#under-way .now")).to_have_text(re.compile("waiting|running"))
    visit.page.reload()  # and it goes on
    expect(visit.page.locator("#under-way .now")).to_have_text(re.compile("running"))
    expect(visit.page.locator("#result [data-status]")).to_have_text("Not correct")
    expect(visit.page.locator("#result.is-old")).to_have_count(0)
    visit.page.get_by_text("What your script printed").click()
    expect(visit.page.get_by_text("<b>not bold</b>").last).to_be_visible()
    assert visit.page.locator("textarea.code").input_value() == slow


SLOW_AT_THE_SECOND_CASE = """
import time
seen = []

def largest_stable_timestep(model, integrator):
    case = float(model.actuator_gainprm[0, 0]), float(model.body_mass[1])
    if case not in seen:
        seen.append(case)
        if len(seen) == 2:
            time.sleep(6)
    return None
"""


def test_a_slow_script_tells_which_case_it_is_at(visit: Visit, browser: Chromium, origin: str) -> None:
    begin(visit)
    visit.page.goto(SERVO)
    visit.page.locator(".code-editor").wait_for()  # as it opens, Chromium would style what is put over a selection
    visit.page.locator("textarea.code").fill(SLOW_AT_THE_SECOND_CASE)
    visit.page.get_by_role("button", name="Run and judge").click()
    expect(visit.page.locator("#under-way .now")).to_have_text("running, case 2 of 7")
    without_scripts = browser.new_context(
        base_url=origin, storage_state=visit.context.storage_state(), java_script_enabled=False
    )
    page = without_scripts.new_page()
    page.goto(SERVO)
    expect(page.locator("#under-way .now")).to_have_text("running, case 2 of 7")
    expect(page.locator("meta[http-equiv=refresh]")).to_be_attached()
    expect(page.locator("#result [data-status]")).to_have_text("Not correct")  # it reloads itself
    without_scripts.close()
    expect(visit.page.locator("#result [data-status]")).to_have_text("Not correct")


def test_a_script_that_runs_is_stopped_and_stays_in_the_editor(visit: Visit) -> None:
    begin(visit)
    visit.page.goto(SERVO)
    visit.page.locator(".code-editor").wait_for()  # as it opens, Chromium would style what is put over a selection
    endless = "while True:\n    pass\n"
    visit.page.locator("textarea.code").fill(endless)
    visit.page.get_by_role("button", name="Run and judge").click()
    expect(visit.page.locator("#under-way .now")).to_have_text(re.compile("running"))
    visit.page.get_by_role("button", name="Stop").click()
    expect(visit.page.locator("[data-trouble]")).to_have_text(STOPPED_RUNNING)
    expect(visit.page.locator("#under-way[data-events]")).to_have_count(0)
    expect(visit.page.locator("#attempts")).to_contain_text("No attempt yet")
    expect(visit.page.locator("textarea.code")).to_have_value(endless)


def test_a_file_that_is_no_script_is_refused_beside_the_editor(visit: Visit, tmp_path: Path) -> None:
    visit.page.goto(SERVO)
    for name, body, why in (
        ("picture.py", b"\xff\xfe\x00", "not UTF-8"), ("m.ipynb", b'{"cells": [], "nbformat": 4}', "a notebook"),
        ("archive.py", b"PK\x03\x04\x00", "not UTF-8"),
    ):  # fmt: skip
        (tmp_path / name).write_bytes(body)
        visit.page.locator("[data-file]").set_input_files(tmp_path / name)
        expect(visit.page.locator("[data-trouble].bad")).to_contain_text(why)
    assert "def largest_stable_timestep" in visit.page.locator("textarea.code").input_value()


PLACES = """question => { window.places = []; const look = () => {
  const button = document.querySelector(`[id="1.3-check--${question}"] form button`).getBoundingClientRect();
  const place = Math.round(button.top + scrollY);
  if (window.places.at(-1) !== place) window.places.push(place);
  requestAnimationFrame(look); }; look(); }"""
"""Keeps every place on the page [px] where a question's button was in any frame."""


@pytest.mark.parametrize("width", [1280, 390])
def test_nothing_jumps_while_the_lab_of_a_prediction_opens(visit: Visit, width: int) -> None:
    page, card = visit.page, visit.card("1.3-check", "q3")
    page.set_viewport_size({"width": width, "height": 800})
    page.evaluate(PLACES, "q4")
    card.get_by_label("implicitfast").check()
    card.get_by_role("button", name="Send").click()
    expect(card.locator(".strips .fault").first).to_be_attached()
    expect(card.get_by_label("integrator")).to_have_value("implicitfast")
    expect(card.locator("[data-message]")).to_contain_text("BADQACC")
    box = card.locator(".lab").bounding_box()
    card.locator("[data-time]").press("End")
    assert len(page.evaluate("window.places")) == 2  # before the verdict, and with it
    after = card.locator(".lab").bounding_box()
    assert box is not None
    assert after is not None
    assert after["height"] == box["height"]


def test_the_lab_of_a_prediction_opens_once_it_is_made(visit: Visit) -> None:
    card = visit.card("1.3-check", "q3")
    expect(card.locator("canvas")).to_have_count(0)
    card.get_by_label("implicitfast").check()
    card.get_by_role("button", name="Send").click()
    expect(card.locator("canvas")).to_be_visible()
    visit.page.reload()
    card.scroll_into_view_if_needed()
    expect(card.locator("canvas")).to_be_visible()
