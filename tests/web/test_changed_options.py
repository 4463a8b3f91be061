"""A choice whose options have moved since it was answered: pages show what was chosen, not what stands there now."""

import json
import re
from pathlib import Path

import httpx
import pytest

from grader.courses.people.identity import COOKIE
from grader.courses.people.sign_in import create_sign_in_code, redeem_sign_in_code
from grader.settings import Settings
from support.sites import Site, open_site, write_content

API = "/api/v1"
ASKED = {"kind": "mcq", "id": "capital", "q": "Which?"}
BEFORE = ASKED | {"options": ["Lyon", "Paris", "Nice"], "answer": 1}
AFTER = ASKED | {"options": ["Paris", "Lyon"], "answer": 0}


def write_quiz(content: Path, question: dict[str, object]) -> None:
    quiz = {"id": "towns", "title": "Towns", "questions": [question]}
    (content / "quizzes" / "towns.json").write_text(json.dumps(quiz))


def sign_in(site: Site, name: str, role: str = "student") -> httpx.Client:
    client = site.client(name, role)
    with site.app.state.services.database.write() as session:
        client.cookies.set(COOKIE, redeem_sign_in_code(session, create_sign_in_code(session, name, role)).secret)
    return client


def checked_in(page: str) -> list[str]:
    """The labels of the radio buttons that are checked."""
    options = re.findall(r"<input[^>]*type=\"radio\"[^>]*>.*?</label>", page, re.DOTALL)
    return [re.sub(r"<[^>]+>|\s+", " ", one).split()[0] for one in options if re.search(r"<input[^>]* checked", one)]


@pytest.mark.parametrize(("chosen", "shown"), [("Paris", ["Paris"]), ("Lyon", ["Lyon"]), ("Nice", [])])
def test_a_page_marks_what_was_chosen(chosen: str, shown: list[str], tmp_path: Path) -> None:
    content = write_content(tmp_path / "content")
    write_quiz(content, BEFORE)
    with open_site(Settings(content=content, data=tmp_path / "data", workers=0)) as site:
        ann, tina = sign_in(site, "ann"), sign_in(site, "tina", "instructor")
        index = BEFORE["options"].index(chosen)  # type: ignore[attr-defined]
        made = ann.post(f"{API}/submissions", json={"quiz": "towns", "question": "capital", "answer": index})
        assert made.status_code == 201, made.text
        assert checked_in(ann.get("/?quiz=towns").text) == [chosen]
        write_quiz(content, AFTER)
        assert tina.post(f"{API}/content:reload").status_code == 200
        assert checked_in(ann.get("/?quiz=towns").text) == shown
        story = tina.get(f"/instructor/learners/{made.json()['learner']}").text
        assert chosen in re.sub(r"<[^>]+>", " ", story)
