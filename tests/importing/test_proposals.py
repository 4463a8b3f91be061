"""The keys of an imported lesson without any `verify`: how many get one that holds, and that pasting it works."""

import json
import shutil
from pathlib import Path

import pytest

from grader.certify.keys import certify_quizzes, propose_for_key
from grader.library import load
from support.command_line import grader
from support.sites import ROOT

LESSON = Path(__file__).with_name("lesson-8.8.md")

NOT_DERIVABLE = {"q15": "of another rod than that of any simulation", "q16": "no option says what it claims"}

pytestmark = pytest.mark.slow


@pytest.fixture
def content(tmp_path: Path) -> Path:
    shutil.copytree(ROOT / "models", tmp_path / "models")
    done = grader("import", str(LESSON), "--out", str(tmp_path / "quizzes"))
    assert done.returncode == 0, done.stderr
    return tmp_path


def test_fifteen_of_seventeen_keys_get_a_verify_that_holds_and_certifies_them_once_pasted(content: Path) -> None:
    library = load(content)
    results = list(certify_quizzes(library, ["8.8-check"]))
    assert [certified.certificate for certified in results] == [None] * 17
    file = content / "quizzes/8.8-check.json"
    raw = json.loads(file.read_text())
    questions = {
        question.id: part for question, part in zip(library.quiz("8.8-check").questions, raw["questions"], strict=True)
    }
    without = set[str]()
    for certified in results:
        proposal = propose_for_key(library, certified.quiz, certified.question, certified.key)
        if proposal is None or not proposal.holds:
            without.add(certified.question.id)
            continue
        part = questions[certified.question.id]
        for step in filter(None, certified.key.place.split(".")):
            part = part[int(step)] if step.isdigit() else part[step]
        part["verify"] = json.loads(f"{{{proposal.paste}}}")["verify"]
    assert without == set(NOT_DERIVABLE)
    file.write_text(json.dumps(raw), encoding="utf-8")
    again = list(certify_quizzes(load(content), ["8.8-check"]))
    verdicts = [certified.certificate.verdict for certified in again if certified.certificate is not None]
    assert verdicts == ["certified"] * 15
