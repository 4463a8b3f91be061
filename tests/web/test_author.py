"""The author's desk: a question's source, its preview, what the check says, and saving without overwriting."""

import html
import json
import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from grader.commands.grade import open_pipeline
from grader.grading.report import Report
from grader.library import PassedChecks
from grader.library.conversion import write_converted
from grader.library.question_text import find_name, find_question
from grader.questions import installed_kinds, parse_question
from grader.service.authoring import make_app
from grader.web.author.desk import AuthorDesk, Check
from grader.web.author.pages import SOURCE_BYTES_MAX
from grader.web.author.preview import list_samples

ROOT = Path(__file__).parents[2]
HOST = "http://127.0.0.1"
SENT = {"Origin": HOST}
SAMPLED = ("mcq", "debug", "predict", "multiple", "order", "match", "numeric", "numbers", "open")
CHECK, CHOICE, NUMBER = "1.3-check", "/edit/1.3-check/q1", "/edit/1.3-check/q2"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A content folder with one quiz."""
    (tmp_path / "quizzes").mkdir()
    shutil.copy(ROOT / "quizzes/1.3-check.json", tmp_path / "quizzes")
    shutil.copytree(ROOT / "models", tmp_path / "models")
    return tmp_path


@pytest.fixture
def browser(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[TestClient]:
    passed = PassedChecks(tmp_path_factory.mktemp("passed"))
    with TestClient(make_app(folder, passed, open_pipeline), base_url=HOST) as client:
        yield client


def wait_for(browser: TestClient, path: str, words: str) -> str:
    """The page once it has these words, after the check."""
    for _ in range(30):
        text = browser.get(path).text
        if words in text:
            return text
        browser.get(path.replace("/edit/", "/changes/"), params={"seen": read_seen(text)})
    raise AssertionError(text)


def read_seen(text: str) -> str:
    match = re.search(r'data-seen="([^"]+)"', text)
    assert match
    return match[1]


def tag_in(text: str) -> str:
    match = re.search(r'name="tag" value="([\w-]+)"', text)
    assert match
    return match[1]


def test_a_question_is_shown_with_its_source_its_certificate_and_how_answers_are_read(browser: TestClient) -> None:
    text = wait_for(browser, NUMBER, "No fault")
    for part in ("1.3-check.json: q2", "Key: certified", "about 5 ms", "A joint with inertia", "After due"):
        assert part in text, part


def test_a_key_without_a_verify_gets_one_to_paste_and_pasting_it_certifies_it(
    browser: TestClient, folder: Path
) -> None:
    sim = {"model": "pendulum", "setup": "data.qpos[0] = 0.5", "seconds": 6,
           "readouts": [{"label": "angle", "expr": "data.qpos[0]", "unit": "rad"}]}  # fmt: skip
    swing = {"kind": "numeric", "q": "How long is its period?", "answer": 1.441, "tol": 0.01, "unit": "s", "sim": sim}
    file = folder / "quizzes/1.3-check.json"
    quiz = json.loads(file.read_text())
    file.write_text(json.dumps(quiz | {"questions": [swing]}))
    text = wait_for(browser, CHOICE, "under which the key holds")
    assert "0 to mend" not in text and "No fault" in text
    (pasted,) = re.findall(r"<textarea[^>]* data-copy>(.*?)</textarea>", text)
    verified = json.loads(f"{json.dumps(swing)[:-1]}, {html.unescape(pasted)}}}")
    file.write_text(json.dumps(quiz | {"questions": [verified]}))
    text = wait_for(browser, CHOICE, "Key: certified")
    assert "data-copy" not in text
    file.write_text(json.dumps(quiz | {"questions": [swing | {"answer": 1.42}]}))  # as for small angles, L = 0.5 m
    text = wait_for(browser, CHOICE, "under which the key does not hold")
    assert "The simulation gives 1.4412" in html.unescape(text) and "No fault" in text


def test_questions_and_exercises_are_added_on_the_page(browser: TestClient, folder: Path) -> None:
    def add(kind: str) -> str:
        answer = browser.post(f"/add/{CHECK}/q1", data={"kind": kind}, headers=SENT)
        assert answer.status_code == 200, answer.text
        return answer.url.path

    offered = re.findall(r"<option[^>]*>([^<]+)</option>", browser.get(CHOICE).text)
    assert {*SAMPLED, "values", "claims"} <= {*offered} and "code" not in offered
    assert add("order") == f"/edit/{CHECK}/order"
    assert add("order") == f"/edit/{CHECK}/order-2"
    assert "No fault" in wait_for(browser, f"/edit/{CHECK}/order", "No fault")
    sent: dict[str, Any] = {"data": {"kind": "exercise:values"}, "headers": SENT}
    added = browser.post(f"/add/{CHECK}/q1", **sent, follow_redirects=False)  # its check would run on after the test
    assert added.headers["Location"] == f"/edit/{CHECK}/code"
    assert (folder / "programs/speed.py").exists()
    (folder / "programs/speed.py").write_text("def another(): ...")
    refused = browser.post(f"/add/{CHECK}/q1", **sent).text
    assert "rename it first" in refused
    assert browser.post(f"/add/{CHECK}/q1", data={"kind": "no-kind"}, headers=SENT).status_code == 404


def test_every_state_is_shown_as_a_student_sees_it(browser: TestClient, folder: Path) -> None:
    assert "Not correct" not in browser.get(CHOICE).text.partition("What the check says")[0]
    wrong = browser.get(f"{CHOICE}?state=wrong").text
    assert "Not correct" in wrong and "the velocity stage, mj_fwdVelocity" in wrong
    assert "mj_collision" not in wrong.partition("data-said")[2].partition("</article>")[0]
    right = browser.get(f"{CHOICE}?state=right").text.partition("data-said")[2].partition("</article>")[0]
    assert "mj_collision" in right
    assert "no due date" in browser.get(f"{CHOICE}?state=due").text
    file = folder / "quizzes/1.3-check.json"
    quiz = json.loads(file.read_text()) | {"policy": {"due": "2026-01-01T00:00Z", "solutions": "after_due"}}
    file.write_text(json.dumps(quiz))
    over = browser.get(f"{CHOICE}?state=due").text.partition("data-said")[2].partition("</article>")[0]
    assert "mj_collision" in over


def test_an_answer_is_judged_and_not_kept(browser: TestClient) -> None:
    sent = browser.post("/try/1.3-check/q2", data={"answer": "7 ms"}, headers=SENT).text
    assert "7\u202fms is too high" in sent
    unread = browser.post("/try/1.3-check/q2", data={"answer": "5 kg"}, headers=SENT).text
    assert "does not measure" in unread
    assert "7 ms" not in browser.get(NUMBER).text.partition("What the check says")[0]


def test_a_change_of_the_file_is_told_with_its_faults(browser: TestClient, folder: Path) -> None:
    wait_for(browser, NUMBER, "No fault")
    file = folder / "quizzes/1.3-check.json"
    file.write_text(file.read_text().replace('"answer": 5, "tol"', '"answer": 6, "tol"'))
    assert "refuted: derived 4.99999" in wait_for(browser, NUMBER, "to mend")
    file.write_text(file.read_text().replace('"tol": 0.05', '"tolerance": 0.05'))
    text = wait_for(browser, NUMBER, "unknown key")
    assert "q2.tolerance" in text and "stands here once the faults" in text
    file.write_text("{")
    assert "broken JSON" in browser.get(NUMBER).text


def test_a_change_while_a_page_is_made_is_not_taken_for_seen(
    browser: TestClient, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    wait = AuthorDesk.wait_for_report

    def wait_and_change(desk: AuthorDesk, check: Check, seconds: float) -> Report | None:
        report = wait(desk, check, seconds)
        (folder / "quizzes/more.jsn").write_text("{}")
        return report

    monkeypatch.setattr(AuthorDesk, "wait_for_report", wait_and_change)
    seen = read_seen(browser.get(NUMBER).text)
    monkeypatch.undo()
    changes = NUMBER.replace("/edit/", "/changes/")
    assert browser.get(changes, params={"seen": seen}).json()["state"] != seen
    wait_for(browser, NUMBER, "rename it")


def test_saving_writes_the_question_alone_and_never_overwrites(browser: TestClient, folder: Path) -> None:
    file = folder / "quizzes/1.3-check.json"
    before, page = file.read_text(), browser.get(NUMBER).text
    start, end = find_question(before, "q2", "a.json")
    mine = before[start:end].replace("largest timestep", "longest timestep")
    match = {"If-Match": f'"{tag_in(page)}"', **SENT}
    saved = browser.put("/source/1.3-check/q2", content=mine, headers=match)
    assert saved.status_code == 204
    assert file.read_text() == before.replace("largest timestep", "longest timestep")
    again = browser.put("/source/1.3-check/q2", content="{}", headers=match)
    assert again.status_code == 412 and "has changed" in again.json()["why"]
    form = {"source": "{typed}", "tag": tag_in(page)}
    refused = browser.post("/source/1.3-check/q2", data=form, headers=SENT).text
    assert "{typed}" in refused and "has changed" in refused
    assert "longest timestep" in file.read_text()
    form = {"source": mine.replace("longest", "greatest"), "tag": saved.headers["ETag"].strip('"')}
    browser.post("/source/1.3-check/q2", data=form, headers=SENT)
    assert "greatest timestep" in file.read_text()
    assert [path.name for path in (folder / "quizzes").iterdir()] == ["1.3-check.json"]


def test_what_is_too_long_is_refused_and_nothing_of_it_is_saved(browser: TestClient, folder: Path) -> None:
    file = folder / "quizzes/1.3-check.json"
    before, match = file.read_text(), {"If-Match": f'"{tag_in(browser.get(NUMBER).text)}"', **SENT}
    saved = browser.put("/source/1.3-check/q2", content="x" * (SOURCE_BYTES_MAX + 1), headers=match)
    assert (saved.status_code, "at most 1 MB" in saved.json()["why"]) == (413, True)
    assert file.read_text() == before


@pytest.mark.parametrize("form", ["json", "md"])
def test_a_question_of_another_id_or_broken_for_a_moment_is_saved_in_its_place_alone(
    browser: TestClient, folder: Path, form: str
) -> None:
    file = folder / "quizzes/1.3-check.json"
    if form == "md":
        [file] = write_converted(file)
    before, page = file.read_text(), browser.get(NUMBER).text
    start, end = find_question(before, "q2", file.name)
    mine = before[start:end]
    named = mine.replace('{"', '{"id": "swing", "', 1) if form == "json" else mine.replace("##", "## {#swing}", 1)
    tag = tag_in(page)
    for source, moved in ((named, True), (named[:-30], None), ("", False), (mine, False), (named + "\n", True)):
        saved = browser.put("/source/1.3-check/q2", content=source, headers={"If-Match": f'"{tag}"', **SENT})
        assert saved.status_code == 204
        assert file.read_text() == before[:start] + source.strip() + before[end:]
        if moved is not None:
            assert saved.headers.get("Location") == ("/edit/1.3-check/swing" if moved else None)
        tag = saved.headers["ETag"].strip('"')
    assert "swing" in browser.get("/edit/1.3-check/swing").text
    sent = {"source": named, "tag": tag}
    answer = browser.post("/source/1.3-check/q2", data=sent, headers=SENT, follow_redirects=False)
    assert answer.headers["Location"] == "/edit/1.3-check/swing"


def test_one_question_never_takes_the_place_of_its_file(browser: TestClient, folder: Path) -> None:
    file = folder / "quizzes/1.3-check.json"
    page = browser.get(NUMBER).text
    start, end = find_question(file.read_text(), "q2", file.name)
    mine = file.read_text()[start:end]
    broken = browser.put(
        "/source/1.3-check/q2", content=mine.replace(",", "", 1), headers={"If-Match": f'"{tag_in(page)}"', **SENT}
    )
    assert broken.status_code == 204
    before, tag = file.read_text(), tag_in(browser.get(NUMBER).text)
    assert tag.endswith("-0-0"), "the whole file is shown"
    refused = browser.put("/source/1.3-check/q2", content=mine, headers={"If-Match": f'"{tag}"', **SENT})
    assert (refused.status_code, "the whole file was shown" in refused.json()["why"]) == (412, True)
    assert file.read_text() == before
    mended = browser.put("/source/1.3-check/q2", content=mine, headers={"If-Match": broken.headers["ETag"], **SENT})
    assert mended.status_code == 204, "the tag of what was saved holds on"
    assert len(json.loads(file.read_text())["questions"]) > 2


@pytest.mark.parametrize(
    "tag",
    [
        "",
        "0",
        "{digest}-1",
        "{digest}-{digest}-1-99999-99999",
        "{digest}-{digest}-0--1-0",
        "{digest}-{part}-1-0-0-0",
        "{digest}-{part}-{length}-0-0",
        "{part}-{part}-{length}-1-1",
        "{part}-{digest}-{length}-0-0",
    ],
)
def test_a_tag_that_no_page_gave_saves_nothing(browser: TestClient, folder: Path, tag: str) -> None:
    file = folder / "quizzes/1.3-check.json"
    before, (digest, part, length, *_) = file.read_text(), tag_in(browser.get(NUMBER).text).split("-")
    headers = {**SENT, "If-Match": f'"{tag.format(digest=digest, part=part, length=length)}"'}
    assert browser.put("/source/1.3-check/q2", content="{}", headers=headers).status_code == 412
    assert file.read_text() == before


@pytest.mark.parametrize("origin", [None, "http://evil.example", "null", "http://127.0.0.1:1"])
def test_another_site_can_write_nothing(browser: TestClient, folder: Path, origin: str | None) -> None:
    before, tag = (folder / "quizzes/1.3-check.json").read_text(), tag_in(browser.get(NUMBER).text)
    headers = {"If-Match": f'"{tag}"'} | ({} if origin is None else {"Origin": origin})
    assert browser.put("/source/1.3-check/q2", content="{}", headers=headers).status_code == 403
    assert browser.get(NUMBER, headers={"Host": "evil.example"}).status_code == 400
    assert (folder / "quizzes/1.3-check.json").read_text() == before


def test_a_lab_runs_on_the_desk(browser: TestClient) -> None:
    assert browser.get("/api/v1/quizzes/1.3-check").json()["questions"][2]["lab"]["controls"]
    run = browser.post("/api/v1/labs:run", json={"quiz": CHECK, "question": "q3", "seconds": 0.1}, headers=SENT)
    assert run.status_code == 200 and run.json()["times"]


def test_what_is_not_there_is_not_found(browser: TestClient) -> None:
    assert browser.get("/edit/none/q1").status_code == 404
    assert browser.get("/edit/1.3-check/none").status_code == 404


def test_a_question_is_found_in_the_text_as_it_was_written() -> None:
    text = '{ "id": "a", "x-note": "\\"questions\\": [1]",\n "questions": [ {"id": "b",\n "q": "]}" } , {"q": 2}]}'
    assert text[slice(*find_question(text, "b", "a.json"))] == '{"id": "b",\n "q": "]}" }'
    assert text[slice(*find_question(text, "q2", "a.json"))] == '{"q": 2}'
    assert find_name(text, text.index('{"q": 2}'), "a.json") == "q2"
    assert [find_name(text, start, "a.json") for start in (0, len(text))] == [None, None]
    assert find_name("{", 0, "a.json") is None


@pytest.mark.parametrize("name", [name for name, kind in installed_kinds().items() if not kind.is_script])
def test_the_first_sample_of_every_kind_is_right_and_another_is_not(name: str) -> None:
    kind = installed_kinds()[name]
    question = parse_question({"id": "q1", **kind.example().question})
    samples = list_samples(question)
    assert samples or name not in SAMPLED
    if not samples:
        return
    tones = [sample.badge.tone for sample in samples]
    assert tones[0] in ("ok", "wait")
    assert kind.is_prose or set(tones[1:]) - {"ok"}


def test_a_question_in_markdown_is_shown_checked_and_saved(browser: TestClient, folder: Path) -> None:
    [written] = write_converted(folder / "quizzes/1.3-check.json")
    text = wait_for(browser, NUMBER, "No fault")
    for part in ("1.3-check.md: q2", "Answer: 5 ms ± 0.05", "Key: certified", "After due"):
        assert part in text, part
    source = "##\n\nHow long?\n\nAnswer: 5 ms\n"
    saved = browser.put("/source/1.3-check/q2", content=source, headers={**SENT, "If-Match": f'"{tag_in(text)}"'})
    assert saved.status_code == 204
    assert "How long?\n\nAnswer: 5 ms\n\n##" in written.read_text()
    assert browser.put("/source/1.3-check/q2", content="", headers={**SENT, "If-Match": '"old"'}).status_code == 412
    written.write_text(written.read_text().replace("Answer: 5 ms", "Answer: five"))
    text = wait_for(browser, NUMBER, "no number")
    assert "write such as Answer:" in text and "q2, &#39;five&#39; is no number" in text


def write_quiz(folder: Path, *questions: dict[str, Any]) -> Path:
    """Writes the quiz with these questions, each with a prompt of its own."""
    asked = [{"kind": "open", "q": f"Why {number}?"} | question for number, question in enumerate(questions)]
    file = folder / f"quizzes/{CHECK}.json"
    file.write_text(json.dumps({"id": CHECK, "title": "A check", "questions": asked}, indent=2, ensure_ascii=False))
    return file


@pytest.mark.parametrize("id_", ["θ1", "a/b", "../..", "..", "", "a?b#c", "a b"])
def test_a_faulty_id_is_saved_and_named_on_the_page_that_follows(browser: TestClient, folder: Path, id_: str) -> None:
    file = write_quiz(folder, {"id": "a"}, {"id": "b"})
    tag, source = tag_in(browser.get(f"/edit/{CHECK}/b").text), json.dumps({"id": id_, "kind": "open", "q": "Why?"})
    saved = browser.put(f"/source/{CHECK}/b", content=source, headers={"If-Match": f'"{tag}"', **SENT})
    assert saved.status_code == 204 and source in file.read_text()
    shown = html.unescape(browser.get(saved.headers["Location"]).text)
    assert f"must match pattern '^[A-Za-z0-9][A-Za-z0-9._-]{{0,63}}$', not '{id_}'" in shown
    assert source in shown and f"not '{id_}'" in html.unescape(browser.get(f"/edit/{CHECK}/a").text)
    sent = {"source": source.replace(json.dumps(id_), '"c"'), "tag": saved.headers["ETag"].strip('"')}
    mended = browser.post(saved.headers["Location"].replace("/edit/", "/source/"), data=sent, headers=SENT)
    assert mended.url.path == f"/edit/{CHECK}/c" and f"{CHECK}.json: c" in mended.text


@pytest.mark.parametrize("form", ["json", "md"])
def test_two_questions_of_one_id_are_both_reached(browser: TestClient, folder: Path, form: str) -> None:
    file = write_quiz(folder, {"id": "a"}, {"id": "b"}, {"id": "a"}, {"id": "c"})
    if form == "md":
        sections = (f"## {{#{id_} .open}}\n\nWhy {number}?\n" for number, id_ in enumerate("abac"))
        file.unlink()
        file.with_suffix(".md").write_text("\n".join(["---\ntitle: A check\n---\n", *sections]))
    text = browser.get(f"/edit/{CHECK}/a").text
    assert "two have this id: give each its own" in text
    links = re.findall(r'href="(/edit/[^"?]+)"[^>]*>([^<]+)</a></li>', text)
    assert [label for _, label in links] == ["a", "b", "a", "c"]
    for number, (link, _) in enumerate(links):
        (source,) = re.findall(
            r'<textarea class="code" id="source"[^>]*>(.*?)</textarea>', browser.get(link).text, re.S
        )
        assert re.findall(r"Why \d", source) == [f"Why {number}"]


def test_a_page_goes_on_with_its_question_when_another_takes_its_id(browser: TestClient, folder: Path) -> None:
    file = write_quiz(folder, {"id": "a"}, {"id": "b"})
    tag = tag_in(browser.get(f"/edit/{CHECK}/b").text)
    file.write_text(file.read_text().replace('"a"', '"b"'))
    assert "Why 1?" in browser.get(f"/edit/{CHECK}/b", params={"shown": tag}).text
    assert "Why 0?" in browser.get(f"/edit/{CHECK}/b").text


def test_a_quiz_of_a_faulty_id_is_found_by_its_file(browser: TestClient, folder: Path) -> None:
    file = write_quiz(folder, {"id": "a"})
    file.write_text(file.read_text().replace(CHECK, "θ/1"))
    begun = browser.get("/")
    assert begun.url.path == f"/edit/{CHECK}/a" and "not &#39;θ/1&#39;" in begun.text
    added = browser.post(f"/add/{CHECK}/a", data={"kind": "open"}, headers=SENT).text
    assert f"mend the id of quizzes/{CHECK}.json first" in added
    assert [path.name for path in (folder / "quizzes").iterdir()] == [file.name]


def test_a_change_of_other_questions_refuses_no_save(browser: TestClient, folder: Path) -> None:
    file = write_quiz(folder, {"id": "a"}, {"id": "b"}, {"id": "c"})
    tags = {id_: tag_in(browser.get(f"/edit/{CHECK}/{id_}").text) for id_ in "abc"}

    def save(id_: str, source: str) -> int:
        headers = {"If-Match": f'"{tags[id_]}"', **SENT}
        return browser.put(f"/source/{CHECK}/{id_}", content=source, headers=headers).status_code

    for id_, words in ("a", "How so?"), ("c", "What for?"), ("b", "Whence, then?"):
        before = file.read_text()
        (start, end), source = (
            find_question(before, id_, file.name),
            json.dumps({"id": id_, "kind": "open", "q": words}),
        )
        if id_ == "b":  # its place is neither the same from the beginning nor from the end: its page has a newer tag
            assert save(id_, source) == 412
            tags[id_] = tag_in(browser.get(f"/edit/{CHECK}/{id_}").text)
        assert save(id_, source) == 204
        assert file.read_text() == before[:start] + source + before[end:]
        assert save(id_, "{}") == 412, "its own part has changed"
    assert [question["q"] for question in json.loads(file.read_text())["questions"]] == [
        "How so?", "Whence, then?", "What for?",
    ]  # fmt: skip


def test_what_is_broken_is_told_with_its_line_in_what_is_shown(browser: TestClient, folder: Path) -> None:
    file = write_quiz(folder, {"id": "a"}, {"id": "b"}, {"id": "c"})
    start, end = find_question(file.read_text(), "b", file.name)
    whole, source = file.read_text(), file.read_text()[start:end]
    tag = tag_in(browser.get(f"/edit/{CHECK}/b").text)

    def save(broken: str, shown: str = "b") -> str:
        nonlocal tag
        saved = browser.put(f"/source/{CHECK}/b", content=broken, headers={"If-Match": f'"{tag}"', **SENT})
        assert saved.status_code == 204
        tag = saved.headers["ETag"].strip('"')
        told = browser.get(f"/edit/{CHECK}/{shown}", params={"shown": tag} if shown == "b" else {}).text
        return html.unescape(told)

    told = save(source.removesuffix("}"))
    assert "line 4, column 16<" in told and "a { has no }: add it" in told and f"{CHECK}.json: b<" in told
    assert "line 4, column 7<" in save(source.replace('"id"', "“id”"))
    assert "write straight quotes" in save(source.replace('"id"', "“id”"))
    assert "line 14, column 5 of the file" in save(source.removesuffix("}"), shown="a")
    assert file.read_text() != whole and save(source) and file.read_text() == whole


def test_a_line_of_markdown_is_that_of_what_is_shown(browser: TestClient, folder: Path) -> None:
    [written] = write_converted(folder / "quizzes/1.3-check.json")
    written.write_text(written.read_text().replace("Answer: 5 ms", "Answer: five"))
    line = written.read_text()[: written.read_text().index("Answer: five")].count("\n") + 1
    shown = find_question(written.read_text(), "q2", written.name)[0]
    of_shown = line - written.read_text()[:shown].count("\n")
    assert f'<td data-column="Key">line {of_shown}<' in browser.get(NUMBER).text
    assert f'<td data-column="Key">line {line} of the file<' in browser.get(CHOICE).text
