"""Every installed kind of lab, with its own example, on the page, over the API and in the commands.

`test_plugin.py` runs this file again with a kind of another package.
"""

import json
import re
from collections.abc import Iterator
from contextlib import nullcontext
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import httpx
import pytest
from jsonschema import Draft202012Validator
from playwright.sync_api import Locator, Page, expect
from pydantic import ValidationError

from grader.errors import ContentError, LabRefused, NotFound
from grader.importing.lesson import import_lesson
from grader.labs import AnyLabKind, LabExample, LabRequest, Limits, lab_adapter, lab_kinds
from grader.library import Library, load
from grader.library.json_schema import build_quiz_schema
from grader.questions import lab_view
from grader.settings import Settings
from support.command_line import grader
from support.sites import Site, open_site
from web.browsing import Chromium, bounded, chromium, findings

API = "/api/v1"
SHOWN = {"id", "kind", "title", "note"}
"""The author's keys that every lab shows."""


@dataclass(frozen=True)
class Case:
    """A kind with its example, as one lab of the quiz `labs`."""

    name: str
    kind: AnyLabKind
    example: LabExample

    @property
    def raw(self) -> dict[str, Any]:
        return {"id": self.name, **self.example.lab}

    @property
    def target(self) -> dict[str, str]:
        return {"quiz": "labs", "lab": self.name}


CASES = {name: Case(name, kind, kind.example()) for name, kind in lab_kinds().items()
         if kind.example().lab["kind"] == name}  # fmt: skip


@pytest.fixture(params=[pytest.param(one, id=name) for name, one in CASES.items()])
def case(request: pytest.FixtureRequest) -> Case:
    found: Case = request.param
    return found


def written(root: Path, labs: list[dict[str, Any]]) -> Path:
    """A content folder with these labs."""
    (root / "quizzes").mkdir()
    for path, text in [pair for one in CASES.values() for pair in one.example.files.items()]:
        (root / path).parent.mkdir(parents=True, exist_ok=True)
        (root / path).write_text(text)
    (root / "quizzes/labs.json").write_text(json.dumps({"id": "labs", "title": "Labs", "labs": labs}))
    return root


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return written(tmp_path_factory.mktemp("content"), [one.raw for one in CASES.values()])


@pytest.fixture(scope="module")
def library(folder: Path) -> Library:
    return load(folder)


@pytest.fixture(scope="module")
def site(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    with open_site(Settings(content=folder, data=tmp_path_factory.mktemp("data"), workers=0)) as site:
        yield site


@pytest.fixture(scope="module")
def ann(site: Site) -> httpx.Client:
    return site.client("ann")


# The author's part.


def test_every_kind_has_an_example() -> None:
    assert {one.kind for one in CASES.values()} == {*lab_kinds().values()}
    for one in CASES.values():
        assert one.example.taken and one.example.refused
        assert "id" not in one.example.lab


def test_the_example_passes_the_check(library: Library, case: Case) -> None:
    lab = next(lab for lab in library.quiz("labs").labs if lab.id == case.name)
    assert isinstance(lab, case.kind.lab)
    assert library.warnings == ()


def test_a_lab_is_frozen_and_dumps_to_what_it_is(case: Case) -> None:
    lab, adapter = lab_adapter().validate_json(json.dumps(case.raw), strict=True), lab_adapter()
    assert adapter.validate_json(adapter.dump_json(lab)) == lab
    with pytest.raises(ValidationError):
        lab.title = "another"


def test_an_unknown_key_is_refused_with_its_place(tmp_path: Path, case: Case) -> None:
    with pytest.raises(ContentError) as raised:
        load(written(tmp_path, [case.raw | {"titel": "T"}]))
    assert {(fault.key, fault.why) for fault in raised.value.faults} == {
        (f"{case.name}.titel", "unknown key: write 'title', or remove it, or begin it with x-")
    }


def test_every_missing_key_is_named(tmp_path: Path, case: Case) -> None:
    with pytest.raises(ContentError) as raised:
        load(written(tmp_path, [{"kind": case.name, "id": case.name}]))
    needed = {name for name, field in case.kind.lab.model_fields.items() if field.is_required()} - {"id", "kind"}
    assert {fault.key for fault in raised.value.faults} == {f"{case.name}.{name}" for name in needed or {"model"}}


def test_a_model_that_is_not_there_is_refused(tmp_path: Path, case: Case) -> None:
    with pytest.raises(ContentError) as raised:
        load(written(tmp_path, [case.raw | {"model": "nowhere"}]))
    assert {fault.key for fault in raised.value.faults} == {f"{case.name}.model"}


def test_the_schema_of_editors_knows_it(case: Case) -> None:
    validator = Draft202012Validator(build_quiz_schema())
    quiz = {"id": "labs", "title": "Labs", "labs": [case.raw | {"x-note": "mine"}]}
    assert [error.message for error in validator.iter_errors(quiz)] == []
    assert not validator.is_valid(quiz | {"labs": [case.raw | {"titel": "T"}]})


def test_a_lesson_in_markdown_brings_it(tmp_path: Path, case: Case) -> None:
    block = {key: value for key, value in case.example.lab.items() if key != "kind"}
    imported = import_lesson(f"# A lesson\n\n```lab {case.name}\n{json.dumps(block)}\n```\n", "2-lesson.md")
    assert imported.remarks == () == imported.faults
    (quiz,) = imported.quizzes.values()
    (lab,) = quiz["labs"]
    assert lab["kind"] == case.name
    assert load(written(tmp_path, [lab])).quiz("labs").labs[0].title == case.example.lab["title"]


@pytest.mark.process
@pytest.mark.parametrize("options", [[], ["--markdown"]])
def test_it_is_begun_by_a_command_twice(tmp_path: Path, case: Case, options: list[str]) -> None:
    course = str(tmp_path / "course")
    assert grader("new", "course", course).returncode == 0
    assert grader("new", "lesson", "2.1", "--in", course, *options).returncode == 0
    for _ in range(2):
        done = grader("new", "lab", case.name, "2.1", "--in", course)
        assert done.returncode == 0, done.stderr
    quiz = load(Path(course)).quiz("2.1")
    assert [lab.id for lab in quiz.labs] == [case.name, f"{case.name}-2"]
    assert len(quiz.questions) == 1


# A learner's part, over the API.


def test_the_api_shows_what_the_kind_names_and_nothing_else(ann: httpx.Client, library: Library, case: Case) -> None:
    shown = next(lab for lab in ann.get(f"{API}/quizzes/labs").json()["labs"] if lab["id"] == case.name)
    lab = next(lab for lab in library.quiz("labs").labs if lab.id == case.name)
    assert shown == lab_view(lab)
    assert shown.keys() == {*SHOWN, *case.kind.view(lab)}


def test_it_runs_as_its_author_wrote_it_and_with_the_settings_it_takes(ann: httpx.Client, case: Case) -> None:
    for controls in ({}, *case.example.taken):
        ran = ann.post(f"{API}/labs:run", json=case.target | {"controls": controls})
        assert ran.status_code == 200, (controls, ran.text)
        assert ran.headers["content-type"] == "application/json"
        assert ran.json()


def test_what_it_does_not_take_is_refused_with_a_sentence(ann: httpx.Client, case: Case) -> None:
    for controls in case.example.refused:
        refused = ann.post(f"{API}/labs:run", json=case.target | {"controls": controls})
        assert refused.status_code == 422, (controls, refused.text)
        assert refused.headers["content-type"] == "application/problem+json"
        assert re.fullmatch(r"\S.*\S\.", refused.json()["detail"], re.DOTALL), refused.text


NONSENSE: list[Any] = [True, -1, 0, 1e300, -1e-300, 10**18, "", "x" * 2000, "\ud800", "NaN", "../../etc/passwd"]


@pytest.mark.parametrize("value", NONSENSE, ids=lambda value: repr(value)[:20])
def test_no_setting_breaks_it(ann: httpx.Client, case: Case, value: Any) -> None:
    names = {name for settings in (*case.example.taken, *case.example.refused) for name in settings}
    for name in (*names, "", "unheard of"):
        body = json.dumps(case.target | {"controls": {name: value}})
        ran = ann.post(f"{API}/labs:run", content=body, headers={"Content-Type": "application/json"})
        assert ran.status_code in (200, 422), (name, value, ran.text)


@pytest.mark.parametrize("controls", ['{"a": NaN}', '{"a": Infinity}', '{"a": 1e999}', '{"a": null}', '{"a": [1]}'])
def test_what_is_no_finite_number_never_reaches_it(ann: httpx.Client, case: Case, controls: str) -> None:
    for name in {name for settings in case.example.taken for name in settings}:
        body = json.dumps(case.target)[:-1] + f', "controls": {controls.replace("a", name, 1)}}}'
        ran = ann.post(f"{API}/labs:run", content=body, headers={"Content-Type": "application/json"})
        assert ran.status_code == 422, ran.text


def test_the_same_run_is_the_same_answer(ann: httpx.Client, case: Case) -> None:
    target = case.target | {"controls": case.example.taken[0]}
    assert ann.post(f"{API}/labs:run", json=target).content == ann.post(f"{API}/labs:run", json=target).content


def with_limits(case: Case, limits: Limits) -> AnyLabKind:
    """The same kind with other limits."""
    made: AnyLabKind = type("Limited", (type(case.kind),), {"limits": limits})()
    return made


def test_an_answer_that_is_too_large_is_refused(library: Library, case: Case) -> None:
    lab = next(lab for lab in library.quiz("labs").labs if lab.id == case.name)
    answer = partial(with_limits(case, Limits(answer_bytes=20, steps=10**9)).answer, lab, LabRequest())
    with pytest.raises(LabRefused, match="larger than"):
        answer(library.model_xml)


def test_the_steps_of_a_run_are_counted(library: Library, case: Case) -> None:
    lab = next(lab for lab in library.quiz("labs").labs if lab.id == case.name)
    assert case.kind.answer(lab, LabRequest(), library.model_xml).steps > 0


def test_without_its_model_nothing_runs(case: Case) -> None:
    def refuse(name: str) -> str:
        raise NotFound(f"There is no model {name!r}.")

    lab: Any = lab_adapter().validate_json(json.dumps(case.raw), strict=True)
    with pytest.raises(NotFound, match="There is no model"):
        case.kind.answer(lab, LabRequest(), refuse)


# A learner's part, on the page.


def box_of(page: str, case: Case) -> str:
    """The card of the lab on the lesson's page."""
    match = re.search(rf'<article [^>]*id="labs--{case.name}".*?</article>', page, re.DOTALL)
    assert match is not None
    return match[0]


def test_the_page_has_its_skeleton_and_a_still(site: Site, case: Case) -> None:
    page = site.anonymous({"Accept": "text/html"}).get("/")
    assert page.status_code == 200
    box = box_of(page.text, case)
    assert f'data-form="{case.name}"' in box
    assert re.search(r'<div class="without-scripts">.*\w.*?</div>', box, re.DOTALL)
    assert not re.search(r"<script|\sstyle=|\son\w+=", box)
    assert not re.search(r"<(?:input|select|button)\b(?![^>]*\bdisabled\b)[^>]*>", box), (
        "nothing works without a script"
    )


def test_its_script_is_served_by_digest_and_with_its_type(site: Site, case: Case) -> None:
    client = site.anonymous()
    (address,) = {*re.findall(r'src="(/static/[0-9a-f]+/)times\.js"', client.get("/").text)}
    script = client.get(f"{address}labs/{case.name}.js")
    assert script.status_code == 200
    assert script.headers["content-type"].split(";")[0] in ("text/javascript", "application/javascript")
    assert script.headers["x-content-type-options"] == "nosniff"
    assert "immutable" in script.headers["cache-control"]
    assert client.get(f"{address}labs/{case.name}.py").status_code == 404
    for path in ("labs/lab.js", f"labs/{case.name}", "labs/../lab.js.js", "labs/%2e%2e/__init__.py"):
        assert client.get(f"{address}{path}").status_code == 404


@pytest.fixture(scope="module")
def browser() -> Iterator[Chromium]:
    with chromium() as browser:
        yield browser


@pytest.fixture
def limit() -> Iterator[None]:
    """No test hangs for ever."""
    with bounded():
        yield


def open_page(browser: Chromium, site: Site, **options: Any) -> Page:
    """The lesson with all labs, in a browser of its own."""
    return browser.new_context(base_url=site.origin, reduced_motion="reduce", **options).new_page()


def open_lab(page: Page, case: Case) -> Locator:
    box = page.locator(f'[data-lab-id="{case.name}"]')
    box.scroll_into_view_if_needed()
    return box


@pytest.mark.browser
@pytest.mark.usefixtures("limit")
@pytest.mark.parametrize("width", [1280, 360])
def test_it_is_drawn_in_a_browser_and_nothing_complains(browser: Chromium, site: Site, case: Case, width: int) -> None:
    page = open_page(browser, site, viewport={"width": width, "height": 800})
    complaints: list[str] = []
    page.on("console", lambda message: complaints.append(message.text) if message.type == "error" else None)
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.goto("/")
    size = page.locator(f'[id="labs--{case.name}"]').bounding_box()
    box = open_lab(page, case)
    message = box.locator("[data-message]")
    before = re.search(r"data-message>(.*?)</p>", box_of(site.anonymous({"Accept": "text/html"}).get("/").text, case))
    assert before is not None
    expect(message).not_to_have_text(before[1], timeout=30_000)
    expect(message).not_to_have_class(re.compile(r"\bno\b"))
    expect(box.locator(".strips path, canvas").first).to_be_attached()
    expect(box.locator("input:disabled, select:disabled")).to_have_count(box.locator(".ghost :disabled").count())
    now = page.locator(f'[id="labs--{case.name}"]').bounding_box()
    assert size is not None and now is not None
    assert (now["width"], now["height"]) == (size["width"], size["height"]), "a script changed a size"
    assert page.evaluate("document.documentElement.scrollWidth <= document.documentElement.clientWidth")
    assert findings(page) == []
    assert complaints == []
    page.context.close()


@pytest.mark.browser
@pytest.mark.usefixtures("limit")
def test_without_javascript_its_still_is_seen_and_nothing_that_does_not_work(
    browser: Chromium, site: Site, case: Case
) -> None:
    page = open_page(browser, site, java_script_enabled=False)
    page.goto("/")
    box = open_lab(page, case)
    still = box.locator(".without-scripts")
    expect(still).to_be_visible()
    assert len(still.inner_text().split()) > 3
    for field in box.locator("input, select, button, canvas, [data-message]").all():
        expect(field).to_be_hidden()
    page.context.close()


@pytest.mark.browser
@pytest.mark.usefixtures("limit")
def test_scripts_of_kinds_are_loaded_where_such_a_lab_comes_near_the_screen(browser: Chromium, site: Site) -> None:
    page = open_page(browser, site, viewport={"width": 1280, "height": 300})
    loaded: list[str] = []
    page.on("request", lambda request: loaded.append(request.url))
    page.goto("/nowhere")
    page.wait_for_load_state("networkidle")
    assert loaded and not [url for url in loaded if "/labs/" in url or url.endswith("/lab.js")]
    page.goto("/")
    for name, case in CASES.items():
        with page.expect_response(re.compile(rf"/labs/{name}\.js$")) if not is_loaded(loaded, name) else nullcontext():
            open_lab(page, case)
    assert {url.rpartition("/")[2] for url in loaded if "/labs/" in url} == {f"{name}.js" for name in CASES}
    page.context.close()


def is_loaded(loaded: list[str], name: str) -> bool:
    """Whether a lab that is near the screen from the start has asked for its script."""
    return any(url.endswith(f"/labs/{name}.js") for url in loaded)
