"""The gradebook and a learner's story say what counts, as the export does."""

import csv
import io
import json
import re
from datetime import timedelta
from pathlib import Path

import httpx
import pytest

from grader.courses.people.erasure import erase_learner
from grader.settings import Settings
from grader.store.tables import now
from support.sites import QUIZ, open_site, write_content
from web.test_instructor_pages import browser, page, words

API = "/api/v1"
BOOK = "/instructor/gradebook"


@pytest.fixture
def content(tmp_path: Path) -> Path:
    return write_content(tmp_path / "content")


def write_quiz(content: Path, id_: str = "small", **changes: object) -> None:
    (content / "quizzes" / f"{id_}.json").write_text(json.dumps(QUIZ | {"id": id_} | changes))


def answer(client: httpx.Client, question: str, given: object) -> str:
    """Hands in, and returns the learner's id."""
    response = client.post(f"{API}/submissions", json={"quiz": "small", "question": question, "answer": given})
    assert response.status_code == 201, response.text
    learner: str = response.json()["learner"]
    return learner


def read_ends(client: httpx.Client, address: str) -> list[tuple[str, str, str]]:
    """Of each row of a gradebook the learner's name, the number of answers, and the points."""
    rows = re.findall(r'<tr><th scope="row".*?</tr>', page(client, address), re.DOTALL)
    words = [re.sub(r"<[^>]*>", " ", row).split() for row in rows]
    return [(row[0], row[-2], row[-1]) for row in words]


def test_who_was_removed_is_marked_and_neither_sent_to_a_platform_nor_reviewed(content: Path, tmp_path: Path) -> None:
    with open_site(Settings(content=content, data=tmp_path / "data", workers=0)) as site:
        ids = {name: answer(site.client(name), "q4", f"{name} says.") for name in ("ann", "bob")}
        tina = browser(site, "tina", "instructor")

        def find(address: str) -> list[str]:
            text = tina.get(address).text
            return [name for name in ids if name in text]

        def count_waiting() -> int:
            return len(tina.get(f"{API}/reviews").json()["items"])

        before = {form: tina.get(f"{API}/gradebook.csv?format={form}").headers["ETag"] for form in ("canvas", "moodle")}
        assert count_waiting() == 2
        assert tina.delete(f"{API}/members/{ids['bob']}").status_code == 204
        for form, etag in before.items():
            assert tina.get(f"{API}/gradebook.csv?format={form}", headers={"If-None-Match": etag}).status_code == 200
            assert find(f"{API}/gradebook.csv?format={form}") == ["ann"]
        assert find(f"{API}/gradebook.csv") == ["ann", "bob"]
        assert count_waiting() == 1
        for quiz in ("", "small"):
            book = words(page(tina, f"{BOOK}?quiz={quiz}"))
            assert "bob removed" in book
            assert "ann removed" not in book
        assert tina.post(f"{API}/invitations", json={"names": ["bob"]}).status_code == 201
        assert count_waiting() == 2


def test_the_story_of_a_removed_learner_says_what_brings_them_back(content: Path, tmp_path: Path) -> None:
    with open_site(Settings(content=content, data=tmp_path / "data", workers=0)) as site:
        tina = browser(site, "tina", "instructor")
        code = tina.put(f"{API}/course/link").json()["join_url"].partition("code=")[2]
        guest = site.anonymous({"Sec-Fetch-Site": "same-origin"})
        guest.post("/join", data={"code": code, "name": "Eve"})
        eve = answer(guest, "q1", 1)
        roster = f"name,namespace,external_id,email\nEve,grader,{eve},eve@x.example\n"
        back = f"import a roster with their name, the namespace grader and the external_id {eve}."

        def see_after_import() -> str:
            done = tina.post(f"{API}/roster:import", content=roster, headers={"Content-Type": "text/csv"}).json()
            assert (done["created"], done["changed"]) == (0, 1)
            return words(page(tina, f"/instructor/learners/{eve}"))

        assert "eve@x.example" in see_after_import()
        tina.delete(f"{API}/members/{eve}")
        assert f"removed from the course To bring them back, with their answers and points, {back}" in words(
            page(tina, f"/instructor/learners/{eve}")
        )
        assert "removed" not in see_after_import()
        database = site.app.state.services.database
        with database.write() as session:
            erase_learner(database, session, member_id=eve)
        erased = words(page(tina, f"/instructor/learners/{eve}"))
        assert ("removed from the course" in erased, "bring them back" in erased) == (True, False)


def test_results_of_a_question_that_the_quiz_has_lost_do_not_count(content: Path, tmp_path: Path) -> None:
    write_quiz(content, "other")
    with open_site(Settings(content=content, data=tmp_path / "data", workers=0)) as site:
        ann, bob, cem = (site.client(name) for name in ("ann", "bob", "cem"))
        tina = browser(site, "tina", "instructor")
        ann_id = answer(ann, "q1", 1)
        answer(ann, "q2", "5 ms")
        answer(bob, "q1", 0)
        answer(cem, "q2", "5 ms")
        first, second, *others = QUIZ["questions"]
        write_quiz(content, questions=[first, second | {"id": "renamed"}, *others])
        assert tina.post(f"{API}/content:reload").status_code == 200
        rows = csv.DictReader(io.StringIO(tina.get(f"{API}/gradebook.csv").text))
        assert {row["user"]: row["points"] for row in rows} == {"ann": "1", "bob": "0", "cem": "0"}
        expected = [("ann", "1", "1"), ("bob", "1", "0"), ("cem", "0", "0")]
        for quiz in ("", "small"):
            assert read_ends(tina, f"{BOOK}?quiz={quiz}") == expected
            fewest_first = read_ends(tina, f"{BOOK}?quiz={quiz}&by=answered&show=incomplete")
            assert fewest_first == [expected[2], *expected[:2]]
        story = words(page(tina, f"/instructor/learners/{ann_id}"))
        assert "Points of what is decided 1 / 1" in story
        assert "Correct 1 / 1 not counted: the quiz has lost this question" in story
        assert story.count("not counted") == 1


def test_points_are_never_more_than_what_they_are_out_of(content: Path, tmp_path: Path) -> None:
    first, *others = QUIZ["questions"]
    write_quiz(content, questions=[first | {"points": 5}])
    write_quiz(content, "other", questions=others)
    with open_site(Settings(content=content, data=tmp_path / "data", workers=0)) as site:
        tina = browser(site, "tina", "instructor")
        answer(site.client("ann"), "q1", 1)
        of_others = sum(question.get("points", 1) for question in others)
        write_quiz(content, questions=[first | {"points": 3}])
        assert tina.post(f"{API}/content:reload").status_code == 200
        answer(site.client("bob"), "q1", 1)
        text = words(page(tina, f"{BOOK}?quiz=small"))
        assert "Points of 3" in text and "1 5 of 5" in text and text.count(" of 5") == text.count("5 of 5")
        book = page(tina, BOOK)
        assert 'title="5 of 5, 1 of 1 answered"' in book and 'title="3 of 3, 1 of 1 answered"' in book
        assert f"1 5 of {5 + of_others}" in words(book) and f"1 3 of {3 + of_others}" not in words(book)


@pytest.mark.parametrize("counts", ["best", "average"])
def test_a_late_right_answer_is_correct_with_the_points_that_count(content: Path, tmp_path: Path, counts: str) -> None:
    """An average over a wrong and a right answer is partly correct."""
    late = {"until": (now() + timedelta(days=9)).isoformat(), "per_day": 0.8, "floor": 0.8}
    write_quiz(content, policy={"due": (now() - timedelta(hours=3)).isoformat(), "late": late, "counts": counts})
    with open_site(Settings(content=content, data=tmp_path / "data", workers=0)) as site:
        ann, bob, tina = site.client("ann"), site.client("bob"), browser(site, "tina", "instructor")
        ann_id = answer(ann, "q1", 1)
        for option in (0, 1):
            bob_id = answer(bob, "q1", option)
        rows = page(tina, f"{BOOK}?quiz=small").partition("<tbody>")[2]
        assert "Correct, 0.8 of 1 0.8 late" in words(rows)
        story = words(page(tina, f"/instructor/learners/{ann_id}"))
        assert "Correct 0.8 / 1 late" in story
        averaged = words(page(tina, f"/instructor/learners/{bob_id}"))
        assert ("Partly correct 0.4 / 1 late" in averaged) == (counts == "average")
