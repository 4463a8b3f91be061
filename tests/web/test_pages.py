"""What the pages hold, and what they keep back, without a browser."""

import json
import re
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest

from grader.settings import Settings
from grader.web.frame.assets import compute_digest, static
from grader.web.text.prose import safe_html
from web.browsing import service

ROOT = Path(__file__).parents[2]
SAME_ORIGIN = {"Sec-Fetch-Site": "same-origin"}


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[httpx.Client]:
    """A learner's browser as far as HTTP goes."""
    with (
        service(Settings(data=tmp_path_factory.mktemp("data"), workers=0)) as origin,
        httpx.Client(base_url=origin, follow_redirects=True) as client,
    ):
        client.post("/session", headers=SAME_ORIGIN)
        yield client


def kept_back() -> list[str]:
    """Texts of the lesson's files that a learner must not get with the questions."""
    texts = []
    for path in (ROOT / "quizzes").glob("1.3-*.json"):
        for question in json.loads(path.read_text(encoding="utf-8")).get("questions", []):
            texts += [question[key] for key in ("explain", "reference") if question.get(key)]
            ids = [case["id"] for case in question.get("check", {}).get("cases", []) if case.get("hidden")]
            texts += [name for name in ids if "-" in name]  # a single word may stand in a prompt too
    return texts


def without_tags(text: str) -> str:
    return re.sub(r"<[^>]*>", "", text)


def test_the_page_shows_every_question_of_the_lesson(client: httpx.Client) -> None:
    text = client.get("/").text
    for path in (ROOT / "quizzes").glob("1.3-*.json"):
        quiz = json.loads(path.read_text(encoding="utf-8"))
        assert text.count(f'data-quiz="{quiz["id"]}"') == 1
    assert len(re.findall(r'data-kind="code"', text)) >= 1
    assert "<msqrt>" in text


def test_the_page_keeps_back_what_would_give_an_answer_away(client: httpx.Client) -> None:
    shown = without_tags(client.get("/").text)
    assert without_tags(safe_html(r"the bound $2\sqrt{I/k_p}$ and explain")) in shown  # the comparison can succeed
    texts = kept_back()
    assert len(texts) > 5
    for kept in texts:
        assert without_tags(safe_html(kept)) not in shown


def test_one_quiz_alone(client: httpx.Client) -> None:
    text = client.get("/", params={"quiz": "1.3-check"}).text
    assert 'data-quiz="1.3-check"' in text
    assert 'data-quiz="1.3-exercises"' not in text
    assert client.get("/", params={"quiz": "nowhere"}).status_code == 404


def test_no_script_or_style_within_the_html(client: httpx.Client) -> None:
    response = client.get("/")
    policy = response.headers["content-security-policy"]
    assert "unsafe" not in policy
    assert "default-src 'none'" in policy
    assert not re.search(r"<style|\sstyle=|\son[a-z]+=|<script(?![^>]*\ssrc=)", response.text)


def test_the_starter_can_be_taken_along(client: httpx.Client) -> None:
    response = client.get("/quizzes/1.3-exercises/servo-threshold/starter.py")
    assert "def largest_stable_timestep" in response.text
    assert response.headers["content-disposition"] == 'attachment; filename="servo_threshold.py"'
    assert client.get("/quizzes/1.3-check/q1/starter.py").status_code == 404


def test_the_instructor_page_tells_others_how_to_sign_in(client: httpx.Client) -> None:
    response = client.get("/instructor")
    assert response.status_code in (401, 403)
    assert "sign-in link" in response.text
    assert "data-submissions" not in response.text
    assert client.get("/instructor/certificates").status_code == 403


STATIC = ROOT / "src/grader/web/static"


@pytest.mark.parametrize("name", sorted(str(path.relative_to(STATIC)) for path in STATIC.rglob("*") if path.is_file()))
def test_every_file_of_the_page_is_served(client: httpx.Client, name: str) -> None:
    first = client.get(f"/static/{name}")
    assert first.status_code == 200
    again = client.get(f"/static/{name}", headers={"If-None-Match": first.headers["etag"]})
    assert again.status_code == 304


def test_files_under_their_digest_are_kept_for_good_and_no_other(client: httpx.Client) -> None:
    address = static("style.css")
    assert f'href="{address}"' in client.get("/").text
    kept, other = client.get(address), client.get(address.replace(compute_digest(), "0" * len(compute_digest())))
    assert kept.headers["cache-control"] == "public, max-age=31536000, immutable"
    assert kept.content == other.content
    assert {one.headers["cache-control"] for one in (other, client.get("/static/style.css"))} == {"no-cache"}
    assert client.get("/static/zzzzzzzzzzzz/style.css").status_code == 404


def test_nothing_else_is_served(client: httpx.Client) -> None:
    for path in ("../routes.py", "..%2Froutes.py", "none.js", ""):
        assert client.get(f"/static/{path}").status_code == 404


@pytest.mark.slow
def test_beyond_loopback_the_questions_need_a_session(tmp_path: Path) -> None:
    settings = Settings(
        data=tmp_path, workers=0, public_origin="https://grader.example.org", allowed_hosts=("127.0.0.1",)
    )
    with service(settings) as origin:
        response = httpx.get(origin)
        assert response.status_code == 401
        assert "Sign in" in response.text
        assert "data-question" not in response.text
        assert httpx.get(f"{origin}/quizzes/1.3-exercises/servo-threshold/starter.py").status_code == 401
