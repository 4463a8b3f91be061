"""Labs over HTTP: shown only after the prediction, checked settings, compressed, the same run from the cache."""

from typing import Any

import httpx
import pytest

from grader.api.lab_cache import LabCache

RUN = "/api/v1/labs:run"
LAB = {"quiz": "small", "question": "q3"}


@pytest.fixture
def predicted(ann: httpx.Client) -> httpx.Client:
    answer = {"quiz": "small", "question": "q3", "answer": 1}
    assert ann.post("/api/v1/submissions", json=answer).status_code == 201
    return ann


def test_a_lab_opens_with_the_prediction_and_not_before(
    ann: httpx.Client, bob: httpx.Client, teacher: httpx.Client
) -> None:
    assert ann.post(RUN, json=LAB).status_code == 409
    invalid = {"quiz": "small", "question": "q3", "answer": True}
    assert ann.post("/api/v1/submissions", json=invalid).json()["verdict"]["status"] == "invalid_answer"
    assert ann.post(RUN, json=LAB).status_code == 409
    assert "lab" not in ann.get("/api/v1/quizzes/small").json()["questions"][2]
    ann.post("/api/v1/submissions", json={"quiz": "small", "question": "q3", "answer": 1})
    assert ann.post(RUN, json=LAB).status_code == 200
    shown = ann.get("/api/v1/quizzes/small").json()["questions"][2]["lab"]
    assert shown["controls"][0]["label"] == "step"
    assert "set" not in shown["controls"][0]
    assert bob.post(RUN, json=LAB).status_code == 409
    assert teacher.post(RUN, json=LAB).status_code == 200


def test_a_run_has_frames_readouts_and_no_warning_here(predicted: httpx.Client) -> None:
    run = predicted.post(RUN, json={**LAB, "controls": {"step": 0.002}, "seconds": 1}).json()
    assert run["controls"] == {"step": 0.002, "stiffness": 100.0}
    assert len(run["times"]) == len(run["frames"]) == len(run["readouts"][0]["values"])
    assert run["readouts"][0]["values"][0] == 1.0
    assert run["warnings"] == []


def test_a_run_that_diverges_says_when(predicted: httpx.Client) -> None:
    run = predicted.post(RUN, json={**LAB, "controls": {"step": 0.02, "stiffness": 40000}}).json()
    assert run["warnings"][0]["kind"] == "BADQACC"
    assert 0 < run["warnings"][0]["time"] < 3


@pytest.mark.parametrize(
    "change",
    [
        {"controls": {"step": 1.0}},
        {"controls": {"step": "0.01"}},
        {"controls": {"step": True}},
        {"controls": {"step": [0.01]}},
        {"controls": {"other": 1}},
        {"events": [[0.1, "none"]]},
        {"events": [[-1, "none"]]},
        {"events": ["x"]},
        {"seconds": 0},
        {"seconds": 1e9},
        {"lab": "x"},
        {"question": None},
        {"more": 1},
    ],
)
def test_settings_that_a_lab_does_not_offer_are_refused(predicted: httpx.Client, change: dict[str, Any]) -> None:
    response = predicted.post(RUN, json={**LAB, **change})
    assert response.status_code == 422
    assert response.headers["content-type"] == "application/problem+json"


NOWHERE = [
    {"quiz": "none", "question": "q3"},
    {"quiz": "small", "question": "q1"},
    {"quiz": "small", "question": "q9"},
    {"quiz": "small", "lab": "x"},
]


@pytest.mark.parametrize("target", NOWHERE)
def test_a_lab_that_is_not_there_is_not_found(ann: httpx.Client, target: dict[str, str]) -> None:
    assert ann.post(RUN, json=target).status_code == 404


def test_answers_are_compressed_where_that_is_understood_and_the_same_twice(predicted: httpx.Client) -> None:
    plain = predicted.post(RUN, json=LAB, headers={"Accept-Encoding": "identity"})
    packed = predicted.post(RUN, json=LAB, headers={"Accept-Encoding": "gzip"})
    assert "content-encoding" not in plain.headers
    assert packed.headers["content-encoding"] == "gzip"
    assert int(packed.headers["content-length"]) < int(plain.headers["content-length"]) / 2
    assert packed.content == plain.content


def test_the_cache_makes_once_and_forgets_the_oldest() -> None:
    cache, made = LabCache(bytes_max=10), list[str]()

    def get(name: str) -> bytes:
        def make() -> bytes:
            made.append(name)
            return name.encode() * 4

        return cache.get(name, make)

    assert [get(name) for name in "aabab"] == [b"aaaa", b"aaaa", b"bbbb", b"aaaa", b"bbbb"]
    get("c")
    get("a")
    get("b")
    assert made == ["a", "b", "c", "a", "b"]


def test_one_scene_under_all_integrators(teacher: httpx.Client) -> None:
    target = {"quiz": "small", "lab": "five"}
    run = teacher.post(RUN, json={**target, "controls": {"timestep": 0.005}}).json()
    assert run["timestep"] == 0.005
    assert [one["name"] for one in run["integrators"]] == ["Euler", "RK4", "implicit", "implicitfast", "discrete"]
    assert teacher.post(RUN, json={**target, "controls": {"key": ""}}).json()["energy"] != run["energy"]
    for controls in (
        {"timestep": 10},
        {"model": "other"},
        {"key": "nowhere"},
        {"timestep": "x"},
        {"steps": 1},
        {"timestep": True},
    ):
        assert teacher.post(RUN, json={**target, "controls": controls}).status_code == 422
    assert teacher.post(RUN, json={**target, "events": [[0, "x"]]}).status_code == 422
