"""Questions with drawn numbers, as two learners, an instructor and another system meet them."""

import math
import re
import shutil
from collections.abc import Iterator
from typing import Any

import httpx
import pytest

from grader.courses.people.identity import COOKIE
from grader.courses.people.sign_in import create_sign_in_code, redeem_sign_in_code
from grader.domain.verdict import Status
from grader.grading.pipeline import Pipeline
from grader.settings import Settings
from support.content import load_content
from support.sites import ROOT, Site, open_site, write_content

API = "/api/v1"
QUIZ, SPEED = "2.1-drawn", "speed"
AT = {"quiz": QUIZ, "question": SPEED}


@pytest.fixture(scope="module")
def shared_site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    folder = tmp_path_factory.mktemp("drawn")
    content = write_content(folder / "content")
    shutil.copy(ROOT / f"quizzes/{QUIZ}.json", content / "quizzes")
    with open_site(Settings(content=content, data=folder / "data", workers=0)) as site:
        yield site


def asked(client: httpx.Client) -> str:
    """The question as this person sees it."""
    return str(find_question(client.get(f"{API}/quizzes/{QUIZ}").json())["q"])


def find_question(quiz: dict[str, Any]) -> dict[str, Any]:
    return next(question for question in quiz["questions"] if question["id"] == SPEED)


def angle_in(text: str) -> float:
    match = re.search(r"let go at ([\d.]+) rad", text)
    assert match, text
    return float(match[1])


def right_at(angle: float) -> float:
    """Closed form: (1/2) I w^2 = m g L (1 - cos angle)."""
    return float((2 * 9.81 * 0.5 * (1 - math.cos(angle)) / 0.2501) ** 0.5)


def answer(client: httpx.Client, value: Any) -> dict[str, Any]:
    made = client.post(f"{API}/submissions", json={**AT, "answer": value})
    assert made.status_code == 201, made.text
    body: dict[str, Any] = made.json()
    return body


def test_each_learner_has_numbers_and_a_key_of_their_own(site: Site, ann: httpx.Client) -> None:
    mine = angle_in(asked(ann))
    others = (site.client(f"bob-{number}") for number in range(20))
    bob = next(one for one in others if abs(angle_in(asked(one)) - mine) > 0.1)  # beyond the tolerance
    theirs = angle_in(asked(bob))
    assert angle_in(asked(ann)) == mine
    made = answer(ann, right_at(mine))
    assert made["verdict"]["status"] == "correct"
    assert made["verdict"]["evidence"]["drawn"] == {"angle": mine}
    same = answer(bob, right_at(mine))
    assert same["verdict"]["status"] == "incorrect"
    assert answer(bob, f"{right_at(theirs) * 57.29578:.4f} deg/s")["verdict"]["status"] == "correct"


def test_the_page_says_whose_the_numbers_are(shared_site: Site, ann: httpx.Client) -> None:
    yours, everyone = "These numbers are yours: each learner has their own.", "Each learner has numbers of their own"
    for client, name, role in ((ann, "ann", "student"), (teacher := shared_site.anonymous(), "tina", "instructor")):
        with shared_site.app.state.services.database.write() as session:
            code = create_sign_in_code(session, name, role)
            client.cookies.set(COOKIE, redeem_sign_in_code(session, code).secret)
    page = ann.get(f"/?quiz={QUIZ}").text
    assert page.count(yours) == 2
    assert yours not in ann.get("/?quiz=small").text
    page = teacher.get(f"/?quiz={QUIZ}").text
    assert (page.count(yours), page.count(everyone)) == (0, 2)


def test_an_instructor_reads_answers_under_the_learners_own_numbers(shared_site: Site, ann: httpx.Client) -> None:
    teacher, me = shared_site.anonymous(), ann.get(f"{API}/me").json()
    with shared_site.app.state.services.database.write() as session:
        code = create_sign_in_code(session, "tina", "instructor", course=me["course"])
        teacher.cookies.set(COOKIE, redeem_sign_in_code(session, code).secret)
    made = ann.post(f"{API}/submissions", json={"quiz": QUIZ, "question": "rest", "answer": "0.7 rad"})
    assert made.status_code == 201
    asked = next(one["q"] for one in ann.get(f"{API}/quizzes/{QUIZ}").json()["questions"] if one["id"] == "rest")
    kp = re.search(r"k_p = \{?([\d.]+)", asked)
    assert kp
    page = teacher.get(f"/instructor/learners/{me['id']}")
    assert f"A servo of kp = {kp[1]}" in page.text


def test_a_slip_is_named_by_the_learners_own_key(ann: httpx.Client) -> None:
    verdict = answer(ann, 2 * right_at(angle_in(asked(ann))))["verdict"]
    assert "factor of two" in (verdict["diagnosis"] or "")


def test_nothing_tells_the_key_or_the_template(ann: httpx.Client) -> None:
    shown = ann.get(f"{API}/quizzes/{QUIZ}").text
    assert not re.search(r"\{angle\}|template|\"draw\"|verify|6\.037", shown)
    checked = ann.post(f"{API}/answers:validate", json={**AT, "answer": "3 rad/s"}).json()
    assert (checked["valid"], checked["read_as"]) == (True, "3 rad/s")


def test_an_instructor_sees_the_numbers_in_the_middle_and_a_learner_as_they_do(
    site: Site, teacher: httpx.Client, ann: httpx.Client
) -> None:
    assert angle_in(asked(teacher)) == 1.5
    made = answer(ann, 1)
    seen = teacher.get(f"{API}/submissions/{made['id']}").json()
    assert seen["verdict"]["evidence"]["drawn"] == {"angle": angle_in(asked(ann))}


def test_another_system_hands_in_for_its_learner(site: Site) -> None:
    lms = site.client("lms", "service")
    body = {**AT, "learner": {"namespace": "school", "id": "s1"}, "answer": 1}
    first = lms.post(f"{API}/lms/submissions", json=body).json()
    angle = first["verdict"]["evidence"]["drawn"]["angle"]
    right = lms.post(f"{API}/lms/submissions", json=body | {"answer": right_at(angle)}).json()
    assert right["verdict"]["status"] == "correct"


def test_another_system_shows_its_learner_the_numbers_that_it_is_graded_by(site: Site) -> None:
    lms = site.client("lms", "service")
    learner = {"learner": {"namespace": "school", "id": "s2"}}
    shown = lms.post(f"{API}/lms/quizzes/{QUIZ}:show", json=learner).json()
    angle = angle_in(find_question(shown)["q"])
    verdict = lms.post(f"{API}/lms/submissions", json={**AT, **learner, "answer": right_at(angle)}).json()["verdict"]
    assert (verdict["status"], verdict["evidence"]["drawn"]) == ("correct", {"angle": angle})
    again = lms.post(f"{API}/lms/quizzes/{QUIZ}:show", json=learner).json()
    assert (angle_in(find_question(again)["q"]), find_question(again)["attempts_used"]) == (angle, 1)
    assert lms.post(f"{API}/lms/quizzes/none:show", json=learner).status_code == 404


def test_a_stored_seed_repeats_the_numbers_whoever_reads_it_again() -> None:
    first, other = (Pipeline(load_content(QUIZ), secret=secret) for secret in (b"one", b"other"))
    parsed = first.read(QUIZ, SPEED, 1, learner="course/ann")
    again = other.read(QUIZ, SPEED, 1, parsed.seed)
    assert (again.question, again.seed) == (parsed.question, parsed.seed)
    assert first.read(QUIZ, SPEED, 1, learner="course/bob").seed != parsed.seed
    assert first.judge(parsed).status is Status.INCORRECT
