"""Every installed kind of question, with its own example, on every page and route and in every command.

`test_plugin.py` runs this file again with a kind of another package.
"""

import json
import re
import secrets
from collections.abc import Callable, Iterator
from contextlib import suppress
from copy import deepcopy
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import httpx
import pytest
from pydantic import ValidationError

from grader.certify.keys import certify_quizzes
from grader.commands.grade import open_pipeline
from grader.courses.people.identity import COOKIE
from grader.courses.people.sign_in import create_sign_in_code, redeem_sign_in_code
from grader.domain.pages.media import Media, find_type, is_served
from grader.domain.verdict import Status
from grader.errors import CallerError, ContentError, InvalidAnswer
from grader.grading.checking import check_content
from grader.grading.processes import Graders
from grader.importing.lesson import import_lesson
from grader.library import Library, load
from grader.library.media import place_media
from grader.questions import AnyKind, Example, Question, installed_kinds, kind_of, parse_question, question_adapter
from grader.service.worker import build_worker
from grader.settings import Settings
from support.command_line import grader
from support.sites import Site, open_site

API = "/api/v1"
SHOWN = {"id", "kind", "label", "title", "q", "points", "attempts"}
"""The author's keys that every question shows."""

UNSEEN = re.compile(r".{8,}|.*[0-9].{4,}", re.DOTALL)
"""Shorter words of an author, such as `hidden`, may stand elsewhere by chance."""


@dataclass(frozen=True)
class Case:
    """A kind with its example, as one question of the quiz `every`, and of `held`, whose feedback is withheld."""

    name: str
    kind: AnyKind
    example: Example

    @property
    def raw(self) -> dict[str, Any]:
        return {**self.example.question, "id": self.name}

    @property
    def question(self) -> Question:
        """The question as it is loaded, with the served addresses of its pictures."""
        bodies = {path: text.encode() for path, text in self.example.files.items() if is_served(path)}
        media = {path: Media(path, find_type(path, body), body) for path, body in bodies.items()}
        return parse_question(place_media(deepcopy(self.raw), media))

    @property
    def right(self) -> Any:
        return self.example.answers[0][0]

    @property
    def best(self) -> Status:
        return self.example.answers[0][1]

    def secrets(self) -> set[str]:
        """The texts and numbers of the author that no learner may see before an answer."""
        hidden = {name: value for name, value in self.raw.items() if name not in SHOWN | {*self.view()}}
        return {text for text in leaves(hidden) if UNSEEN.fullmatch(text) and text not in json.dumps(self.view())}

    def view(self) -> dict[str, Any]:
        return self.kind.view(self.question)


def leaves(value: Any) -> Iterator[str]:
    """Every text and number in a JSON value."""
    if isinstance(value, dict | list):
        for item in value.values() if isinstance(value, dict) else value:
            yield from leaves(item)
    elif value is not None and not isinstance(value, bool):
        yield str(value)


CASES = {name: Case(name, kind, kind.example()) for name, kind in installed_kinds().items()
         if kind.example().question["kind"] == name}  # fmt: skip


JAILED = [
    pytest.param(one, id=name, marks=(pytest.mark.jail, pytest.mark.slow) if one.kind.is_script else ())
    for name, one in CASES.items()
]
"""The same, to try each where a script must run."""


Work = Callable[[Site, Case], None]


@pytest.fixture(params=[pytest.param(one, id=name) for name, one in CASES.items()])
def case(request: pytest.FixtureRequest) -> Case:
    found: Case = request.param
    return found


def test_every_kind_has_an_example() -> None:
    assert {one.kind for one in CASES.values()} == {*installed_kinds().values()}
    for one in CASES.values():
        statuses = [status for _, status in one.example.answers]
        assert statuses[0] in (Status.CORRECT, Status.NEEDS_REVIEW)
        assert Status.INVALID_ANSWER in statuses
        assert one.best is Status.NEEDS_REVIEW or Status.INCORRECT in statuses


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return written(tmp_path_factory.mktemp("content"), [one.raw for one in CASES.values()])


def written(root: Path, questions: list[dict[str, Any]]) -> Path:
    """A content folder with the questions twice: in the quiz `every`, and in `held`, whose feedback is published."""
    for path, text in [pair for one in CASES.values() for pair in one.example.files.items()]:
        (root / path).parent.mkdir(parents=True, exist_ok=True)
        (root / path).write_text(text)
    (root / "quizzes").mkdir()
    for name, policy in (("every", {}), ("held", {"feedback": "after_publish"})):
        quiz = {"id": name, "title": name, "policy": policy, "questions": questions}
        (root / "quizzes" / f"{name}.json").write_text(json.dumps(quiz))
    return root


@pytest.fixture(scope="module")
def library(folder: Path) -> Library:
    return load(folder)


@pytest.fixture(scope="module")
def whole_site(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    with open_site(Settings(content=folder, data=tmp_path_factory.mktemp("data"), workers=0)) as site:
        yield site


@pytest.fixture
def site(whole_site: Site) -> Site:
    return replace(whole_site, course=f"course-{secrets.token_hex(4)}")


@pytest.fixture(scope="module")
def work() -> Iterator[Work]:
    """Does all jobs; scripts in one grading process, which starts with the first of them."""
    graders = Graders(1, allow_t2=False)
    started = cache(graders.start)

    def do_all(site: Site, case: Case) -> None:
        if case.kind.is_script:
            started()
        context = site.app.state.services
        worker = build_worker(site.settings, context.database, context.content.archive, graders)
        while worker.do_one():
            pass

    yield do_all
    graders.close()


def hand_in(client: httpx.Client, case: Case, answer: Any, quiz: str = "every") -> httpx.Response:
    return client.post(f"{API}/submissions", json={"quiz": quiz, "question": case.name, "answer": answer})


# The author's part.


def test_the_example_loads_without_a_remark(library: Library, case: Case) -> None:
    question = library.question("every", case.name)
    assert kind_of(question) is case.kind
    assert [warning for warning in library.warnings if warning.key.startswith(f"{case.name}.")] == []


def test_a_question_is_frozen_and_dumps_to_what_it_is(case: Case) -> None:
    question, adapter = case.question, question_adapter()
    assert adapter.validate_json(adapter.dump_json(question)) == question
    assert case.raw.keys() <= json.loads(adapter.dump_json(question)).keys()
    with pytest.raises(ValidationError):
        question.points = 7.0


def test_an_unknown_key_is_refused_with_its_place(tmp_path: Path, case: Case) -> None:
    with pytest.raises(ContentError) as raised:
        load(written(tmp_path, [case.raw | {"piont": 1}]))
    assert {(fault.key, fault.why) for fault in raised.value.faults} == {
        (f"{case.name}.piont", "unknown key: write 'points', or remove it, or begin it with x-")
    }


def test_every_missing_key_is_named(tmp_path: Path, case: Case) -> None:
    with pytest.raises(ContentError) as raised:
        load(written(tmp_path, [{"kind": case.name, "id": case.name}]))
    needed = {name for name, field in case.kind.question.model_fields.items() if field.is_required()} - {"id", "kind"}
    assert {fault.key for fault in raised.value.faults} == {f"{case.name}.{name}" for name in needed}


def test_a_verify_is_refused_where_there_is_no_key(tmp_path: Path, case: Case) -> None:
    raw = case.raw | {"verify": {"by": "expression", "expr": "1"}}
    if any(not key.place for key in case.kind.answer_keys(case.question)):
        assert load(written(tmp_path, [raw])).question("every", case.name).verify
        return
    with pytest.raises(ContentError, match="has no key to derive again"):
        load(written(tmp_path, [raw]))


def test_every_key_can_be_certified_or_refused(library: Library, case: Case) -> None:
    keys = [certified for certified in certify_quizzes(library, ["every"]) if certified.question.id == case.name]
    assert [certified.key for certified in keys] == list(case.kind.answer_keys(case.question))
    for one in keys:
        assert one.certificate is None or one.certificate.ok


def test_a_lesson_in_markdown_has_it(tmp_path: Path, case: Case) -> None:
    text = f"# Lesson\n\n```quiz\n{json.dumps({'questions': [case.raw]})}\n```\n"
    imported = import_lesson(text, "lesson").quizzes["lesson-check"]
    assert imported["questions"] == [case.raw]
    for fence in case.kind.fences:
        block = {name: value for name, value in case.raw.items() if name != "kind"}
        (question,) = import_lesson(f"```{fence}\n{json.dumps(block)}\n```\n").quizzes["lesson-check"]["questions"]
        assert kind_of(parse_question(question)) is case.kind


def test_what_is_imported_loads(tmp_path: Path, case: Case) -> None:
    text = f"```quiz\n{json.dumps({'questions': [case.raw]})}\n```\n"
    imported = import_lesson(text).quizzes["lesson-check"]["questions"]
    assert load(written(tmp_path, imported)).question("every", case.name) == case.question


@pytest.mark.jail
def test_the_content_holds(folder: Path) -> None:
    report = check_content(folder, open_pipeline, lambda _: None)
    assert report.faults == []


# A learner's part, over the API.


def test_the_api_shows_the_question_and_nothing_secret(site: Site, case: Case) -> None:
    shown = site.client("ann").get(f"{API}/quizzes/every")
    (question,) = [one for one in shown.json()["questions"] if one["id"] == case.name]
    assert question.items() >= {"kind": case.name, "q": case.raw["q"], **case.view()}.items()
    assert case.raw.keys() & question.keys() <= SHOWN | {*case.view(), "starter"}
    assert [secret for secret in case.secrets() if secret in json.dumps(question)] == []


def test_the_openapi_document_names_the_kind(whole_site: Site, case: Case) -> None:
    schema = whole_site.app.openapi()["components"]["schemas"]["QuestionView"]
    assert case.name in schema["properties"]["kind"]["enum"]


def test_every_answer_is_read_before_it_is_sent(site: Site, case: Case) -> None:
    ann = site.client("ann")
    for answer, status in case.example.answers:
        body = {"quiz": "every", "question": case.name, "answer": answer}
        told = ann.post(f"{API}/answers:validate", json=body).json()
        assert told["valid"] is (status is not Status.INVALID_ANSWER), answer
        assert told["read_as" if told["valid"] else "message"]


@pytest.mark.parametrize("nonsense", [None, True, 1e300, "", "\0", [], [[]], {}, {"answer": 0}, [{"low": "x"}]])
def test_no_answer_breaks_it(case: Case, nonsense: Any) -> None:
    with suppress(InvalidAnswer, CallerError):
        assert case.kind.describe(case.question, case.kind.read(case.question, nonsense))
    assert isinstance(case.kind.show(case.question, nonsense), str)
    assert all(
        isinstance(text, str) for values in case.kind.to_form(case.question, nonsense).values() for text in values
    )


@pytest.mark.parametrize("case", JAILED)
def test_every_answer_gets_its_status(site: Site, case: Case, work: Work) -> None:
    for index, (answer, status) in enumerate(case.example.answers):
        client = site.client(f"learner{index}")
        sent = hand_in(client, case, answer)
        is_queued = case.kind.is_script and status is not Status.INVALID_ANSWER
        assert sent.status_code == (202 if is_queued else 201), sent.text
        if is_queued:
            work(site, case)
        verdict = client.get(f"{API}/submissions/{sent.json()['id']}").json()["verdict"]
        assert verdict["status"] == status, answer
        assert verdict["max_points"] == case.question.points
        assert sum(finding["points"] for finding in verdict["findings"]) == verdict["points"]


@pytest.mark.parametrize("case", JAILED)
def test_a_learner_sees_what_the_policy_allows(site: Site, case: Case, work: Work) -> None:
    ann, tina = site.client("ann"), site.client("tina", "instructor")
    sent = hand_in(ann, case, case.example.answers[-2][0], "held")
    if sent.status_code == 202:
        work(site, case)
    path = f"{API}/submissions/{sent.json()['id']}"
    held = ann.get(path)
    assert held.json()["withheld"] and held.json()["verdict"]["findings"] == []
    assert [secret for secret in case.secrets() if secret in held.text] == []
    full = tina.get(path).json()["verdict"]
    assert full["status"] == held.json()["verdict"]["status"] or full["findings"]


# A learner's part, on pages without JavaScript.


@pytest.fixture(scope="module")
def page_site(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    """A server of its own, whose scripts stay in the queue."""
    with open_site(Settings(content=folder, data=tmp_path_factory.mktemp("pages"), workers=0)) as site:
        yield site


@pytest.fixture
def reader(page_site: Site) -> httpx.Client:
    """A browser on loopback, without a session; the first answer begins one."""
    return page_site.anonymous({"Accept": "text/html", "Origin": page_site.origin})


def card_of(page: str, case: Case) -> str:
    """The card of a question on the lesson's page."""
    match = re.search(rf'<article [^>]*id="every--{case.name}".*?</article>', page, re.DOTALL)
    assert match is not None
    return match[0]


def posted(reader: httpx.Client, case: Case, answer: Any) -> httpx.Response:
    """A form with the fields of an answer."""
    fields = {name: list(values) for name, values in case.kind.to_form(case.question, answer).items()}
    return reader.post(f"/quizzes/every/{case.name}", data={"back": "/?quiz=every"} | fields)


def test_the_lesson_shows_its_field_and_nothing_secret(reader: httpx.Client, case: Case) -> None:
    page = reader.get("/?quiz=every")
    assert page.status_code == 200
    card = card_of(page.text, case)
    if case.kind.is_script:
        editor = reader.get(f"/quizzes/every/{case.name}").text
        assert 'name="answer"' in editor
        card += editor
    else:
        assert re.search(r'name="answer["\.]', card)
    assert [secret for secret in case.secrets() if secret in card] == []


@pytest.mark.parametrize("index", range(3))
def test_a_form_is_an_answer(reader: httpx.Client, case: Case, index: int) -> None:
    answer, _ = case.example.answers[index]
    sent = posted(reader, case, answer)
    if not is_read_from_its_form(case, answer):
        assert sent.status_code == 422
        assert "data-status" not in card_of(reader.get("/?quiz=every").text, case)
        return
    assert sent.status_code == 303, sent.text
    page = reader.get(sent.headers["location"]).text
    shown = page if case.kind.is_script else card_of(page, case)
    assert "data-status" in shown or "under-way" in shown
    for text in leaves(case.kind.to_form(case.question, answer)):
        assert f'value="{text}"' in shown or visible(text) in visible(shown)


def is_read_from_its_form(case: Case, answer: Any) -> bool:
    """Whether the form that shows an answer can be sent: the API refuses the number 7 as a text, and a form has "7"."""
    try:
        case.kind.read(case.question, case.kind.from_form(case.question, case.kind.to_form(case.question, answer)))
    except InvalidAnswer:
        return False
    return True


def test_what_was_typed_is_shown_again_where_it_is_refused(reader: httpx.Client, case: Case) -> None:
    fields = dict.fromkeys(case.kind.to_form(case.question, case.right), "{untaken}")
    refused = reader.post(f"/quizzes/every/{case.name}", data={"back": "/?quiz=every"} | fields)
    if refused.status_code == 303:  # of a text or a script everything is taken
        assert case.kind.is_prose or case.kind.is_script
        return
    assert refused.status_code == 422
    card = card_of(refused.text, case)
    assert card.count("{untaken}") >= len(fields) or 'type="radio"' in card or "<select" in card


def test_an_empty_form_touches_nothing_and_says_what_to_do(reader: httpx.Client, case: Case) -> None:
    refused = reader.post(f"/quizzes/every/{case.name}", data={"back": "/?quiz=every"})
    assert refused.status_code == 422
    assert re.search(r"data-trouble>\s*<svg.*?</svg>\s*\w", refused.text, re.DOTALL)
    assert "data-status" not in card_of(reader.get("/?quiz=every").text, case)


def test_a_form_reads_back_as_the_same_answer(case: Case) -> None:
    for answer, status in case.example.answers:
        if status is not Status.INVALID_ANSWER:
            again = case.kind.from_form(case.question, case.kind.to_form(case.question, answer))
            assert case.kind.read(case.question, again) == case.kind.read(case.question, answer)


# An instructor's part.


@pytest.fixture
def handed_in(site: Site, case: Case) -> tuple[httpx.Client, str]:
    """An instructor with a token and a session, and the id of a submission."""
    made = hand_in(site.client("ann"), case, case.right)
    tina = site.client("tina", "instructor")
    with site.app.state.services.database.write() as session:
        code = create_sign_in_code(session, "tina", "instructor", site.course)
        tina.cookies.set(COOKIE, redeem_sign_in_code(session, code).secret)
    return tina, made.json()["id"]


@pytest.mark.parametrize("case", JAILED)
def test_instructors_see_the_answer_everywhere(
    site: Site, handed_in: tuple[httpx.Client, str], case: Case, work: Work
) -> None:
    tina, submission = handed_in
    work(site, case)
    told = tina.get(f"{API}/submissions/{submission}").json()
    learner = next(item["id"] for item in tina.get(f"{API}/members").json()["items"] if item["name"] == "ann")
    answer = case.kind.show(case.question, case.right).strip()
    review = tina.get(f"/instructor/review/{submission}")
    assert review.status_code == 200
    for line in answer.splitlines():  # numbers and comments may stand between the lines of a script
        assert visible(line) in visible(review.text)
    story = tina.get(f"/instructor/learners/{learner}")
    assert story.status_code == 200
    if told["learner"] is not None:  # answers that wait bear a pseudonym
        assert visible(answer) in visible(story.text)
    for page in ("statistics", "gradebook"):
        assert tina.get(f"/instructor/{page}?quiz=every").status_code == 200
    assert tina.get(f"{API}/quizzes/every/statistics").status_code == 200
    assert f"every/{case.name}" in tina.get(f"{API}/gradebook.csv").text
    assert tina.get(f"/instructor/learners/{learner}/lessons/every").status_code in (200, 404)


def visible(text: str) -> str:
    """A text without tags, entities and spaces."""
    return re.sub(r"<[^>]*>|&\w+;|&#\d+;|['\"&<>]|\s", "", text)


@pytest.mark.parametrize("case", JAILED)
def test_the_feed_of_results_has_it(site: Site, case: Case, work: Work) -> None:
    hand_in(site.client("ann"), case, case.right)
    work(site, case)
    (row,) = site.client("lms", "service").get(f"{API}/results").json()["items"]
    assert (row["question"], row["max_points"]) == (case.name, case.question.points)


@pytest.mark.parametrize("case", JAILED)
def test_a_regrade_by_the_same_content_changes_nothing(site: Site, case: Case, work: Work) -> None:
    hand_in(site.client("ann"), case, case.right)
    tina = site.client("tina", "instructor")
    work(site, case)
    body = {"quiz": "every", "question": case.name, "scope": "all", "dry_run": True}
    started = tina.post(f"{API}/regrades", json=body)
    work(site, case)
    done = tina.get(started.headers["location"]).json()
    assert (done["status"], done["progress"]["outcomes"]) == ("done", {"same": 1})


# Commands.


@pytest.mark.parametrize("case", JAILED)
def test_the_command_line_grades_it(folder: Path, tmp_path: Path, case: Case, monkeypatch: pytest.MonkeyPatch) -> None:
    text = case.right if isinstance(case.right, str) else json.dumps(case.right)
    if case.kind.is_script:
        (tmp_path / "answer.py").write_text(case.kind.show(case.question, case.right))
        text = str(tmp_path / "answer.py")
    monkeypatch.setenv("GRADER_CONTENT", str(folder))
    monkeypatch.setenv("GRADER_ALLOW_T2", "true")
    graded = grader("grade", "every", case.name, text, "--json")
    assert json.loads(graded.stdout)["status"] == case.best, graded.stderr
