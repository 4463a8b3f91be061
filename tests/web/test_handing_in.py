"""Exercises that take MJCF or a file instead of a script: through the page, the API, the command line and the jail."""

import base64
import io
import json
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
from playwright.sync_api import expect
from typer.testing import CliRunner

from grader.commands.main import cli
from grader.courses.people.identity import COOKIE
from grader.domain.verdict import Status
from grader.errors import ContentError, Unprocessable
from grader.exercises import Case, DrawnCase, ExerciseParameters, Judgement, Kind, Results, Trial
from grader.grading.checking import check_content
from grader.grading.pipeline import Pipeline
from grader.library import load
from grader.pack.gradescope import build_scripts
from grader.pack.kit import list_texts
from grader.questions.kinds.script import ScriptQuestion
from grader.sandbox.jail import Jail
from grader.settings import Settings
from grader.web.frame.multipart import parse_multipart, read_boundary
from support.kinds import install_kinds
from support.sites import ROOT, Site, open_site
from web.browsing import Chromium

pytestmark = pytest.mark.jail

DRIVER = """
import io
import numpy as np

def trial(functions, inputs, submit):
    (handed_in,) = functions
    given = handed_in("whatever", "arguments")
    if isinstance(given, bytes):
        submit("total", np.array(np.load(io.BytesIO(given), allow_pickle=False)["weights"].sum()))
    else:
        submit("total", np.array(given.count("<geom")))
"""


class Counting(Kind[ExerciseParameters, None, None]):
    """Asks for a model of three geoms, or a file of weights whose sum is 3."""

    parameters = ExerciseParameters
    driver = DRIVER
    takes = ("mjcf", "npz")
    needs_model = False

    def build_trials(self, parameters: ExerciseParameters, drawn: DrawnCase[Case]) -> Sequence[Trial[None]]:
        return [Trial(drawn.case.id, {}, None)]

    def judge(self, parameters: ExerciseParameters, trial: Trial[None], results: Results) -> Judgement[None]:
        total = results.get("total", np.zeros(()))
        return Judgement(bool(total.shape == () and total == 3), "It is three." if total == 3 else "Not three.", None)

    def bound_luck(self, parameters: ExerciseParameters, trials: Sequence[Trial[None]]) -> float:
        return 0.0


EXCEPT = "<!-- except 'this' \"and\" \\ \u202f -->"
THREE = f"<mujoco>{EXCEPT}\n<worldbody><geom size='1'/><geom size='1'/><geom size='1'/></worldbody></mujoco>\n"
STARTER = "<mujoco>\n  <worldbody/>\n</mujoco>\n"


def pack(**arrays: Any) -> bytes:
    """A file as numpy.savez writes it."""
    written = io.BytesIO()
    np.savez(written, **arrays)
    return written.getvalue()


WEIGHTS = pack(weights=np.array([1.0, 2.0]))


@pytest.fixture(scope="module")
def jail() -> Iterator[Jail]:
    with Jail(ROOT / "models", workers=1) as jail:
        yield jail


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    install_kinds(monkeypatch, counting=Counting())
    check = {"kind": "counting", "cases": [{"id": "seen"}, {"id": "unseen", "hidden": True}]}
    common = {"kind": "code", "q": "Make three.", "check": check}
    questions = [
        {**common, "id": "three-geoms", "takes": "mjcf", "starter": "starters/three.xml"},
        {**common, "id": "weights", "takes": "npz"},
    ]
    content = tmp_path / "content"
    files = {
        "quizzes/made.json": json.dumps({"id": "made", "title": "Made", "questions": questions}),
        "starters/three.xml": STARTER,
        "models/any.xml": STARTER,
        "reference_solutions/made/three-geoms/correct__three.xml": THREE,
        "reference_solutions/made/three-geoms/incorrect__two.xml": f"<!-- diagnosis: Not three. -->\n{STARTER}",
        "reference_solutions/made/weights/incorrect__four.txt": "# diagnosis: Not three.\n",
    }
    for path, text in files.items():
        (content / path).parent.mkdir(parents=True, exist_ok=True)
        (content / path).write_text(text, encoding="utf-8")
    (content / "reference_solutions/made/weights/correct__three.npz").write_bytes(WEIGHTS)
    (content / "reference_solutions/made/weights/incorrect__four.npz").write_bytes(pack(weights=np.full(4, 1.0)))
    return content


@pytest.fixture
def site(folder: Path, tmp_path: Path) -> Iterator[Site]:
    with open_site(Settings(content=folder, data=tmp_path / "data", workers=0)) as site:
        yield site


def test_models_and_files_are_judged_and_checked(folder: Path, jail: Jail) -> None:
    pipeline = Pipeline(load(folder), jail.run)
    encoded = base64.b64encode(WEIGHTS).decode()
    for question, answer, status in (
        ("three-geoms", {"source": THREE}, Status.CORRECT),
        ("three-geoms", {"source": "def answer():\n    return '<geom <geom <geom'"}, Status.CORRECT),  # it is text
        ("three-geoms", {"source": STARTER}, Status.INCORRECT),
        ("three-geoms", {"source": " \n"}, Status.INVALID_ANSWER),
        ("weights", {"file": encoded}, Status.CORRECT),
        ("weights", {"file": base64.b64encode(pack(weights=np.ones(4))).decode()}, Status.INCORRECT),
        ("weights", {"file": base64.b64encode(pack(weights=np.array([{}]))).decode()}, Status.CRASHED),  # no pickle
        ("weights", {"file": base64.b64encode(b"PK not really").decode()}, Status.CRASHED),
        ("weights", {"file": base64.b64encode(b"text").decode()}, Status.INVALID_ANSWER),
        ("weights", {"file": ""}, Status.INVALID_ANSWER),
    ):
        verdict = pipeline.grade("made", question, answer)
        assert verdict.status is status, (question, answer, verdict.diagnosis)
        assert verdict.line is None
    for question, wrong in (
        ("weights", {"source": "x"}), ("weights", {"file": "*"}), ("three-geoms", {"file": encoded}),
    ):  # fmt: skip
        with pytest.raises(Unprocessable, match="The answer to this exercise is"):
            pipeline.read("made", question, wrong)
    largest = base64.b64encode(b"PK" + bytes(256 * 1024 - 2)).decode()
    assert pipeline.grade("made", "weights", {"file": largest}).status is Status.CRASHED
    report = check_content(folder, lambda library: jail_pipeline(library, jail), lambda said: None)
    assert not report.faults
    assert len(report.references) == 4


class jail_pipeline:  # noqa: N801 - a context manager
    """A pipeline on a jail that is open already."""

    def __init__(self, library: Any, jail: Jail) -> None:
        self.pipeline = Pipeline(library, jail.run)

    def __enter__(self) -> Pipeline:
        return self.pipeline

    def __exit__(self, *_: object) -> None:
        pass


@pytest.mark.parametrize(
    ("question", "changed", "key"),
    [
        ("three-geoms", {"takes": "python", "entry": "f"}, "three-geoms.takes"),
        ("three-geoms", {"takes": "python"}, "three-geoms.entry"),
        ("three-geoms", {"takes": "urdf"}, "three-geoms.takes"),
        ("three-geoms", {"starter": "starters/three.py"}, "three-geoms.starter"),
    ],
)
def test_what_a_kind_does_not_take_is_a_fault(folder: Path, question: str, changed: dict[str, str], key: str) -> None:
    quiz = folder / "quizzes/made.json"
    raw = json.loads(quiz.read_text())
    next(one for one in raw["questions"] if one["id"] == question).update(changed)
    quiz.write_text(json.dumps(raw))
    with pytest.raises(ContentError) as refused:
        load(folder)
    assert key in [fault.key for fault in refused.value.faults]


def send(browser: httpx.Client, page: str, data: bytes, name: str = "mine.npz") -> httpx.Response:
    """Sends the form of a page with a file, as a browser without JavaScript does."""
    hidden = dict(re.findall(r'<input type="hidden" name="(\w+)" value="([^"]*)"', page))
    return browser.post("/quizzes/made/weights", data=hidden, files={"answer": (name, data)})


def test_the_pages_take_models_and_files_without_javascript(site: Site) -> None:
    browser = httpx.Client(
        base_url=site.origin, follow_redirects=True, verify=False,
        headers={"Sec-Fetch-Site": "same-origin", "Accept": "text/html"},
    )  # fmt: skip
    page = browser.get("/quizzes/made/three-geoms").text
    assert 'data-takes="mjcf"' in page
    assert "&lt;worldbody/&gt;" in page
    assert "three_geoms.xml" in page
    assert browser.get("/quizzes/made/three-geoms/starter.xml").text == STARTER
    assert browser.get("/quizzes/made/three-geoms/starter.py").status_code == 404
    hidden = dict(re.findall(r'<input type="hidden" name="(\w+)" value="([^"]*)"', page))
    sent = browser.post("/quizzes/made/three-geoms", data={**hidden, "answer": THREE})
    assert sent.status_code == 200
    assert COOKIE in browser.cookies

    page = browser.get("/quizzes/made/weights").text
    assert 'enctype="multipart/form-data"' in page
    assert 'accept=".npz,.onnx"' in page
    assert "A .npz or .onnx file of at most 256" in page
    assert "<textarea" not in page
    refused = send(browser, page, b"", "")
    assert refused.status_code == 422
    assert "Choose your file first." in refused.text
    assert "no .npz file" in send(browser, page, b"text").text
    assert send(browser, page, b"PK" + bytes(256 * 1024 + 1000)).status_code == 413
    page = send(browser, page, WEIGHTS).text
    assert f"Handed in last: a file of {len(WEIGHTS) / 1024:.1f} KB" in page
    mine = browser.get("/api/v1/submissions").json()["items"]
    assert [one["question"] for one in mine if one["question"] == "weights"]
    browser.close()
    answers = {"weights": {"file": base64.b64encode(WEIGHTS).decode()}, "three-geoms": {"source": THREE}}
    for question, answer in answers.items():
        body = {"quiz": "made", "question": question, "answer": answer}
        assert client_post(site, "/submissions", body).status_code == 202
        assert client_post(site, "/answers:validate", body).json()["valid"]


def client_post(site: Site, path: str, body: dict[str, Any]) -> httpx.Response:
    return site.client("student").post(f"/api/v1{path}", json=body)


def test_forms_with_files_are_read_to_the_byte() -> None:
    data = bytes(range(256)) * 2 + b"\r\n--edge\r\n"
    lines = [
        b"--edge--x", b'Content-Disposition: form-data; name="after"', b"", b"a\0b",
        b"--edge--x", b'Content-Disposition: form-data; name="answer"; filename="\xc3\xa4;b.npz"', b"Content-Type: x/y",
        b"", data, b"--edge--x--", b"",
    ]  # fmt: skip
    boundary = read_boundary('multipart/form-data; boundary="edge--x"')
    assert boundary == b"edge--x"
    fields = parse_multipart(b"\r\n".join(lines), boundary, 10)
    assert fields == {"after": ["ab"], "answer": [base64.b64encode(data).decode()]}
    assert read_boundary("application/x-www-form-urlencoded") is None
    with pytest.raises(Unprocessable):
        read_boundary('multipart/form-data; boundary=X; a="' + ";" * 1000)
    long = lines[0] + b'\r\nContent-Disposition: form-data; name="a"' + b";" * 1000 + b"\r\n\r\n\r\n--edge--x--"
    for broken in (
        long,
        b"",
        b"\r\n".join(lines[:-2]),
        b"x" + b"\r\n".join(lines),
        b"--edge--x\r\n\r\nz\r\n--edge--x--",
    ):
        with pytest.raises(Unprocessable):
            parse_multipart(broken, boundary, 10)
    with pytest.raises(Unprocessable):
        parse_multipart(b"\r\n".join(lines), boundary, 1)


def test_the_command_line_and_the_packs_know_the_files(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("GRADER_CONTENT", str(folder))
    references = folder / "reference_solutions/made"
    for question, file in (("three-geoms", "correct__three.xml"), ("weights", "correct__three.npz")):
        told = CliRunner().invoke(cli, ["grade", "made", question, str(references / question / file)])
        assert told.exit_code == 0, told.output
        assert told.output.startswith("correct: 1 of 1 point\n")
    library = load(folder)
    kit = list_texts(library, "made", "three-geoms", judged=True)
    assert kit["three_geoms.xml"] == STARTER
    assert json.loads(kit["exercise.json"])["takes"] == "mjcf"
    assert not [path for path in kit if path.endswith(".ipynb")]
    assert "numpy.savez" in list_texts(library, "made", "weights", judged=True)["README.md"]
    for name, suffix in (("three-geoms", ".xml"), ("weights", "'.npz .onnx'")):
        asked = library.question("made", name)
        assert isinstance(asked, ScriptQuestion)
        said = next(script for script in build_scripts("made", asked, allow_t2=False) if script.path == "exercise.sh")
        assert f"SUFFIXES={suffix}" in said.data.decode()


def test_a_browser_sends_a_file_and_edits_a_model(site: Site, browser: Chromium, tmp_path: Path) -> None:
    (tmp_path / "mine.npz").write_bytes(WEIGHTS)
    context = browser.new_context(base_url=site.origin)
    page = context.new_page()
    page.goto("/quizzes/made/weights")
    page.get_by_role("button", name="Run and judge").click()
    expect(page.locator("[data-trouble]")).to_contain_text("Choose your file first.")
    page.locator("input[type=file]").set_input_files(tmp_path / "mine.npz")
    page.get_by_role("button", name="Run and judge").click()
    expect(page.locator("[data-live] .steps")).to_contain_text("handed in")
    page.reload()
    expect(page.get_by_text(f"Handed in last: a file of {len(WEIGHTS) / 1024:.1f} KB")).to_be_visible()
    page.goto("/quizzes/made/three-geoms")
    editor = page.get_by_role("textbox", name="three_geoms.xml, code")
    expect(editor).to_contain_text("<worldbody/>")
    expect(editor.locator("span[class]")).to_have_count(0)
    page.locator("[data-file]").set_input_files({"name": "m.xml", "mimeType": "text/xml", "buffer": THREE.encode()})
    expect(page.locator("textarea.code")).to_have_value(THREE)
    context.close()
