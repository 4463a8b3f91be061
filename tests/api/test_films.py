"""Films of a verdict: the judge's runs again, for whom, and as far as the policy shows what they tell."""

import gzip
import json
import shutil
import time
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import httpx
import pytest

from grader.gate.admission import PREFIX as API
from grader.settings import Settings
from support.sites import ROOT, Site, open_site

pytestmark = [pytest.mark.slow, pytest.mark.jail]

LATER = (datetime.now(UTC) + timedelta(days=30)).isoformat()
QUIZZES: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    "open": ({}, {}),
    "withheld": ({"due": LATER, "feedback": "after_due"}, {}),
    "direction": ({}, {"reveal": "direction"}),
    "solved": ({"solutions": "with_feedback"}, {}),
}
"""Quizzes by their policy, and what their questions have besides."""

SCRIPTS = {"servo-threshold": "incorrect__returns_the_bound.py", "rk4-step": "incorrect__stages_half_as_far.py"}
BYTES_MAX = 48_000
FRAMES_MAX = 121


def write_quizzes(folder: Path) -> Path:
    """Two exercises of the lesson under every policy, each with its visible case and one hidden one."""
    (folder / "quizzes").mkdir(parents=True)
    shutil.copytree(ROOT / "models", folder / "models")
    lesson = json.loads((ROOT / "quizzes/1.3-exercises.json").read_text(encoding="utf-8"))
    for name, (policy, more) in QUIZZES.items():
        questions = [{**question, **more} for question in lesson["questions"] if question["id"] in SCRIPTS]
        for one in questions:
            one.pop("starter", None)
            one["check"] = {**one["check"], "cases": one["check"]["cases"][:2]}
        quiz = {**lesson, "id": name, "policy": {**lesson.get("policy", {}), **policy}, "questions": questions}
        (folder / "quizzes" / f"{name}.json").write_text(json.dumps(quiz), encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    folder = tmp_path_factory.mktemp("site")
    settings = Settings(data=folder / "data", content=write_quizzes(folder / "content"), workers=1)
    with open_site(settings) as site:
        yield site


@pytest.fixture(scope="module")
def handed(site: Site) -> dict[tuple[str, str], str]:
    """The addresses of Ann's graded answers, by quiz and question."""
    ann, made = site.client("ann"), {}
    for quiz in QUIZZES:
        for question, script in SCRIPTS.items():
            source = (ROOT / "reference_solutions/1.3-exercises" / question / script).read_text(encoding="utf-8")
            body = {"quiz": quiz, "question": question, "answer": {"source": source}}
            made[quiz, question] = ann.post(f"{API}/submissions", json=body).headers["location"]
    deadline = time.monotonic() + 240
    for location in made.values():
        while ann.get(location).json()["status"] in ("queued", "running"):
            assert time.monotonic() < deadline
            time.sleep(0.1)
    return made


@pytest.fixture(scope="module")
def ann(site: Site) -> httpx.Client:
    return site.client("ann")


@pytest.fixture(scope="module")
def teacher(site: Site) -> httpx.Client:
    return site.client("tina", "instructor")


def films(client: httpx.Client, location: str) -> list[dict[str, Any]]:
    response = client.get(f"{location}/films")
    assert response.status_code == 200, response.text
    recorded: list[dict[str, Any]] = response.json()["films"]
    return recorded


def test_a_claim_is_let_go_at_both_ends(ann: httpx.Client, handed: dict[tuple[str, str], str]) -> None:
    lower, upper = films(ann, handed["open", "servo-threshold"])
    assert [lower["name"], upper["name"]] == ["lower-end", "upper-end"]
    assert [panel["title"] for panel in lower["panels"]] == ["Euler", "implicitfast", "discrete"]
    assert {panel["detail"] for panel in lower["panels"]} == {"22.17 ms"}
    euler, *others = lower["panels"]
    assert euler["ended"].startswith("BADQACC at 0.42")
    assert [panel["ended"] for panel in others] == ["", ""]
    assert euler["times"][1] == pytest.approx(0.0221652, abs=1e-6)  # every step
    assert euler["values"][0] == 1
    assert max(map(abs, euler["values"])) > 1e5 > 1 >= abs(others[0]["values"][-1])


def test_a_step_moves_beside_the_right_one(ann: httpx.Client, handed: dict[tuple[str, str], str]) -> None:
    [film] = films(ann, handed["open", "rk4-step"])
    theirs, ours = film["panels"]
    assert (theirs["title"], theirs["behind"], ours["behind"]) == ("Your step", 1, None)
    assert theirs["times"] == ours["times"]
    assert theirs["frames"][0] == ours["frames"][0]  # the same start
    apart = abs(theirs["values"][-1] - ours["values"][-1])
    verdict = ann.get(handed["open", "rk4-step"]).json()["verdict"]
    assert film["distance"]["values"] == verdict["evidence"]["differences"][0]["qpos"]
    assert 1e-4 < apart <= max(film["distance"]["values"])


@pytest.mark.parametrize("question", SCRIPTS)
def test_a_film_is_small(ann: httpx.Client, handed: dict[tuple[str, str], str], question: str) -> None:
    response = ann.get(f"{handed['open', question]}/films", headers={"Accept-Encoding": "gzip"})
    assert response.headers["content-encoding"] == "gzip"
    assert len(gzip.compress(response.content, 5)) <= BYTES_MAX
    for film in response.json()["films"]:
        assert all(len(panel["frames"]) == len(panel["times"]) <= FRAMES_MAX for panel in film["panels"])
    plain = ann.get(f"{handed['open', question]}/films", headers={"Accept-Encoding": "identity"})
    assert "content-encoding" not in plain.headers
    assert plain.json() == response.json()


def test_only_its_learner_and_instructors_see_a_film(
    site: Site, teacher: httpx.Client, handed: dict[tuple[str, str], str]
) -> None:
    location = handed["open", "servo-threshold"]
    assert site.anonymous().get(f"{location}/films").status_code == 401
    assert site.client("bob").get(f"{location}/films").status_code == 404
    assert site.client("lms", "service").get(f"{location}/films").status_code == 403
    assert site.client("zoe", "instructor", "another").get(f"{location}/films").status_code == 404
    assert films(teacher, location)


def test_the_limits_are_filmed_with_the_solution_alone(
    ann: httpx.Client, teacher: httpx.Client, handed: dict[tuple[str, str], str]
) -> None:
    def name(client: httpx.Client, quiz: str) -> list[str]:
        return [film["name"] for film in films(client, handed[quiz, "servo-threshold"])]

    with_limits = ["lower-end", "upper-end", "below", "above"]
    assert name(teacher, "open") == with_limits
    assert name(ann, "open") == ["lower-end", "upper-end"]
    assert name(ann, "solved") == with_limits
    below, above = films(ann, handed["solved", "servo-threshold"])[2:]
    assert [panel["ended"] != "" for panel in below["panels"][:2]] == [False, False]
    assert [panel["ended"] != "" for panel in above["panels"][:2]] == [True, True]


@pytest.mark.parametrize("question", SCRIPTS)
def test_before_the_feedback_there_is_no_film(
    ann: httpx.Client, teacher: httpx.Client, handed: dict[tuple[str, str], str], question: str
) -> None:
    assert films(teacher, handed["withheld", question])  # so that the runs of others are recorded already
    assert films(ann, handed["withheld", question]) == []


def test_where_the_direction_alone_is_revealed_no_distance_is_shown(
    ann: httpx.Client, handed: dict[tuple[str, str], str]
) -> None:
    assert films(ann, handed["direction", "rk4-step"]) == []
    names = [film["name"] for film in films(ann, handed["direction", "servo-threshold"])]
    assert names == ["lower-end", "upper-end"]


def test_a_timestep_of_ones_own_is_run_where_the_limits_are_shown(
    ann: httpx.Client, teacher: httpx.Client, handed: dict[tuple[str, str], str]
) -> None:
    def run(client: httpx.Client, quiz: str, question: str, timestep_ms: str) -> httpx.Response:
        return client.get(f"{handed[quiz, question]}/films?timestep_ms={timestep_ms}")

    [film] = run(ann, "solved", "servo-threshold", "18.5").json()["films"]
    assert {panel["detail"] for panel in film["panels"]} == {"18.5 ms"}
    assert {panel["ended"] for panel in film["panels"]} == {""}
    [film] = run(teacher, "open", "servo-threshold", "30").json()["films"]
    assert [panel["ended"] != "" for panel in film["panels"]] == [True, True, False]
    assert run(ann, "open", "servo-threshold", "18.5").json() == {"films": []}
    assert run(ann, "withheld", "servo-threshold", "18.5").json() == {"films": []}
    assert run(ann, "solved", "servo-threshold", "900").json() == {"films": []}  # beyond the search
    assert run(ann, "solved", "rk4-step", "18.5").json() == {"films": []}
    for wrong in ("0", "-1", "nan", "inf", "1e9", "soon"):
        assert run(ann, "solved", "servo-threshold", wrong).status_code == 422
