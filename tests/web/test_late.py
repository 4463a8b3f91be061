"""What the pages say of answers that were handed in after the due date."""

import json
import re
from collections.abc import Iterator
from datetime import timedelta

import pytest

from grader.settings import Settings
from grader.store.tables import now
from support.sites import Site, open_site, write_content


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    content = write_content(tmp_path_factory.mktemp("late") / "content")
    late = {"until": (now() + timedelta(days=9)).isoformat(), "per_day": 0.5, "floor": 0.5}
    policy = {"due": (now() - timedelta(hours=3)).isoformat(), "late": late}
    file = content / "quizzes" / "small.json"
    file.write_text(json.dumps(json.loads(file.read_text()) | {"policy": policy}))
    with open_site(Settings(content=content, data=tmp_path_factory.mktemp("data"), workers=0)) as site:
        yield site


def answer_late(site: Site, option: int) -> str:
    """Hands in an option as a new learner, and returns the page of the quiz."""
    learner = site.anonymous({"Accept": "text/html", "Sec-Fetch-Site": "same-origin", "Origin": site.origin})
    learner.post("/session")
    given = {"quiz": "small", "question": "q1", "answer": option}
    assert learner.post("/api/v1/submissions", json=given).status_code == 201
    return learner.get("/?quiz=small").text


def test_a_late_verdict_says_what_counts_of_its_points(site: Site) -> None:
    page = answer_late(site, 1)
    assert "1 of 1 point, late: 0.5 counts, attempt 1" in page
    assert "An earlier attempt counts" not in page  # than which it has more points, but not more that count


def test_nothing_is_taken_from_no_points(site: Site) -> None:
    assert "0 of 1 point, attempt 1" in answer_late(site, 0)


def test_the_card_of_a_lesson_says_until_when_late_answers_are_taken(site: Site) -> None:
    learner = site.anonymous({"Accept": "text/html", "Sec-Fetch-Site": "same-origin", "Origin": site.origin})
    learner.post("/session")
    page = re.sub(r"<[^>]+>", "", learner.get("/").text)
    assert re.search(r"over since \w{3} [^,]+, [0-9:]+ UTC, late answers until \w{3} [^,]+, [0-9:]+ UTC", page)


def test_a_lesson_tells_when_each_of_its_quizzes_is_due(tmp_path_factory: pytest.TempPathFactory) -> None:
    content = write_content(tmp_path_factory.mktemp("dues") / "content")
    file = content / "quizzes" / "small.json"
    quiz = json.loads(file.read_text())
    for id_, due in (("9.9-a", "2190-11-27T18:00Z"), ("9.9-b", "2190-12-04T18:00Z"), ("9.9-c", "2190-12-04T18:00Z")):
        (file.parent / f"{id_}.json").write_text(json.dumps(quiz | {"id": id_, "policy": {"due": due}}))
    with open_site(Settings(content=content, data=tmp_path_factory.mktemp("data"), workers=0)) as site:
        learner = site.anonymous({"Accept": "text/html", "Sec-Fetch-Site": "same-origin", "Origin": site.origin})
        learner.post("/session")
        page = re.sub(r"<[^>]+>", "", learner.get("/").text)
    assert "Sat 27 Nov 2190, 18:00 UTC, then Sat 4 Dec 2190, 18:00 UTC" in page


def test_a_lesson_is_not_over_with_one_of_its_quizzes(tmp_path_factory: pytest.TempPathFactory) -> None:
    content = write_content(tmp_path_factory.mktemp("mixed") / "content")
    file = content / "quizzes" / "small.json"
    for id_, policy in (("9.9-a", {"due": "2020-11-27T18:00Z"}), ("9.9-b", {})):
        (file.parent / f"{id_}.json").write_text(
            json.dumps(json.loads(file.read_text()) | {"id": id_, "policy": policy})
        )
    with open_site(Settings(content=content, data=tmp_path_factory.mktemp("data"), workers=0)) as site:
        learner = site.anonymous({"Accept": "text/html", "Sec-Fetch-Site": "same-origin", "Origin": site.origin})
        learner.post("/session")
        page = re.sub(r"<[^>]+>", "", learner.get("/").text)
    assert "1 of 2 quizzes over since Fri 27 Nov 2020, 18:00 UTC" in page
