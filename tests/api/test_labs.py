"""Labs over HTTP: shown only after the prediction, checked settings, compressed, the same run from the cache."""

import asyncio
import gzip
import json
import queue
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

import httpx
import pytest

from grader.errors import TooManyRequests, Unprocessable
from grader.gate.lab_runs import THREADS, WAITING_MAX, LabRuns, Recording

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


@pytest.mark.parametrize("kind", ["numeric", "numbers"])
def test_the_lab_of_a_number_opens_with_the_first_answer(
    kind: str, open_site_with: Callable[..., Any], tmp_path: Path
) -> None:
    number = {"answer": 3, "unit": "m", "verify": {"by": "expression", "expr": "3"}}
    sim = {"xml": "<mujoco><worldbody><body><freejoint/><geom size='1'/></body></worldbody></mujoco>", "seconds": 1,
           "readouts": [{"label": "height", "expr": "data.qpos[2] + 77"}]}  # fmt: skip
    field = {"id": "x", "label": "x"}
    own = number if kind == "numeric" else {"fields": [field | number]}
    (tmp_path / "quizzes").mkdir()
    quiz = {"id": "own", "title": "Own", "questions": [{"kind": kind, "q": "How far?", "sim": sim} | own]}
    (tmp_path / "quizzes/own.json").write_text(json.dumps(quiz))
    ann = open_site_with(content=tmp_path).client("ann")
    (view,) = ann.get("/api/v1/quizzes/own").json()["questions"]
    assert view["has_lab"] is True and "77" not in json.dumps(view) and "lab" not in view
    asked = {"quiz": "own", "question": "q1"}
    assert ann.post(RUN, json=asked).status_code == 409
    wrong = "2 m" if kind == "numeric" else {"x": "2 m"}
    assert ann.post("/api/v1/submissions", json=asked | {"answer": wrong}).json()["verdict"]["status"] == "incorrect"
    assert ann.post(RUN, json=asked).json()["readouts"][0]["label"] == "height"


def test_a_run_has_frames_readouts_and_no_warning_here(predicted: httpx.Client) -> None:
    run = predicted.post(RUN, json={**LAB, "controls": {"step": 0.002}, "seconds": 1}).json()
    assert run["controls"] == {"step": 0.002, "stiffness": 100.0}
    assert len(run["times"]) == len(run["frames"]) == len(run["readouts"][0]["values"])
    assert run["readouts"][0]["values"][0] == 1.0
    assert run["warnings"] == []


def test_a_body_is_pulled_and_what_no_run_may_have_is_refused(predicted: httpx.Client) -> None:
    run = predicted.post(RUN, json={**LAB, "seconds": 1}).json()
    moving = next(index for index, geom in enumerate(run["geoms"]) if geom["body"])
    pull = {"geom": moving, "point": [0, 0, -0.5], "goal": [1, 0, 1], "begin": 0.5, "end": 0.9}
    pulled = predicted.post(RUN, json={**LAB, "seconds": 1, "pulls": [pull]}).json()
    assert pulled["readouts"][0]["values"][-1] != run["readouts"][0]["values"][-1]
    for wrong in ({"geom": -1}, {"geom": 99}, {"end": 0.4}, {"goal": [1, 2]}, {"point": ["x", 0, 0]}, {"more": 1}):
        assert predicted.post(RUN, json={**LAB, "seconds": 1, "pulls": [pull | wrong]}).status_code == 422
    assert predicted.post(RUN, json={**LAB, "pulls": [pull] * 9}).status_code == 422


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


ANN, BOB, CAT = (("course", name) for name in ("ann", "bob", "cat"))
MANY_STEPS = 10**9


def test_the_cache_makes_once_and_forgets_the_oldest() -> None:
    made = list[str]()

    async def all_of(names: str) -> list[bytes]:
        runs = LabRuns(10, MANY_STEPS)

        def make(name: str) -> Recording:
            made.append(name)
            return Recording(name.encode() * 4, 1)

        return [await runs.get(ANN, name, partial(make, name)) for name in names]

    got = asyncio.run(all_of("aababcab"))
    assert got == [name.encode() * 4 for name in "aababcab"]
    assert made == ["a", "b", "c", "a", "b"]


def test_a_run_in_progress_is_shared_and_its_first_asker_pays() -> None:
    made = list[str]()

    def make() -> Recording:
        made.append("x")
        time.sleep(0.05)
        return Recording(b"x", 60)

    async def ask() -> None:
        runs = LabRuns(0, 60)
        assert await asyncio.gather(*(runs.get(who, "x", make) for who in [ANN, *[BOB] * 20])) == [b"x"] * 21
        assert made == ["x"]
        with pytest.raises(TooManyRequests, match="60 steps a minute") as refused:
            await runs.get(ANN, "x", make)
        assert refused.value.retry_after_s >= 1
        assert await runs.get(BOB, "x", make) == b"x"

    asyncio.run(ask())


def test_each_learner_waits_for_at_most_one_run_of_every_other() -> None:
    begun, may_end = queue.SimpleQueue[str](), threading.Semaphore(0)

    def make(name: str) -> Recording:
        begun.put(name)
        assert may_end.acquire(timeout=30)
        return Recording(b"", 1)

    async def ask() -> list[str]:
        runs = LabRuns(0, MANY_STEPS)
        asked = [(ANN, f"ann{n}") for n in range(WAITING_MAX)] + [(BOB, "bob0"), (BOB, "bob1"), (CAT, "cat0")]
        waiting = [asyncio.create_task(runs.get(who, name, partial(make, name))) for who, name in asked]
        await asyncio.sleep(0)
        with pytest.raises(TooManyRequests, match="not finished"):
            await runs.get(ANN, "one too many", partial(make, "one too many"))
        order = [await asyncio.to_thread(begun.get, timeout=30) for _ in range(THREADS)]
        while len(order) < len(asked):
            may_end.release()  # one run ends at a time, so that one begins
            order.append(await asyncio.to_thread(begun.get, timeout=30))
        may_end.release(THREADS)
        await asyncio.gather(*waiting)
        return order

    order = asyncio.run(ask())
    assert sorted(order[:THREADS]) == [f"ann{n}" for n in range(THREADS)]
    assert order[THREADS:] == ["ann2", "bob0", "cat0", "ann3", "bob1", *(f"ann{n}" for n in range(4, WAITING_MAX))]


def test_a_run_is_refused_when_its_turn_comes_after_the_budget_is_spent_and_the_next_asker_pays() -> None:
    made = list[str]()

    def make(name: str) -> Recording:
        made.append(name)
        time.sleep(0.02)
        return Recording(b"x", 60)

    async def ask() -> None:
        runs = LabRuns(0, 60)
        mine = [asyncio.create_task(runs.get(ANN, name, partial(make, name))) for name in "abcd"]
        await asyncio.sleep(0)
        shared = asyncio.create_task(runs.get(BOB, "d", partial(make, "d")))
        outcomes = await asyncio.gather(*mine, return_exceptions=True)
        assert [isinstance(outcome, TooManyRequests) for outcome in outcomes] == [False] * THREADS + [True] * (
            4 - THREADS
        )
        assert await shared == b"x"

    asyncio.run(ask())
    assert sorted(made) == ["a", "b", "d"]


def test_a_run_that_fails_is_paid_by_its_cpu_time() -> None:
    def make() -> Recording:
        began = time.thread_time()
        while time.thread_time() - began < 0.02:
            pass
        raise Unprocessable("no")

    async def ask() -> None:
        runs = LabRuns(10, 1000)
        with pytest.raises(Unprocessable):
            await runs.get(ANN, "x", make)
        with pytest.raises(TooManyRequests) as refused:
            await runs.get(ANN, "x", make)
        assert refused.value.retry_after_s >= 60

    asyncio.run(ask())


@pytest.mark.slow
def test_labs_keep_nobody_else_waiting(open_site_with: Callable[..., Any], monkeypatch: pytest.MonkeyPatch) -> None:
    go = threading.Event()

    def slow(*_: object) -> Recording:
        assert go.wait(60)
        return Recording(gzip.compress(b"{}"), 1)

    monkeypatch.setattr("grader.api.learning.labs.record", slow)
    site = open_site_with()
    clients = [site.client("ann") for _ in range(44)]
    body = {"quiz": "small", "lab": "five"}
    with ThreadPoolExecutor(44) as pool:
        asked = [
            pool.submit(client.post, RUN, json={**body, "controls": {"timestep": 0.001 + n / 10_000}})
            for n, client in enumerate(clients)
        ]
        try:
            while sum(one.done() for one in asked) < 44 - WAITING_MAX:
                time.sleep(0.01)
            assert site.client("bob").get("/api/v1/quizzes").status_code == 200
        finally:
            go.set()
        statuses = sorted(one.result().status_code for one in asked)
    assert statuses == [200] * WAITING_MAX + [429] * (44 - WAITING_MAX)


def test_the_budget_of_steps_is_each_learners_own(open_site_with: Callable[..., Any]) -> None:
    site = open_site_with(lab_steps_per_min=500)
    ann, bob = site.client("ann"), site.client("bob")
    body: dict[str, Any] = {"quiz": "small", "lab": "five"}
    assert ann.post(RUN, json=body).status_code == 200
    refused = ann.post(RUN, json={**body, "controls": {"timestep": 0.005}})
    assert refused.status_code == 429
    assert int(refused.headers["retry-after"]) > 10
    assert "steps a minute" in refused.json()["detail"]
    assert ann.post(RUN, json=body).status_code == 200
    assert bob.post(RUN, json={**body, "controls": {"timestep": 0.005}}).status_code == 200


def test_one_scene_under_all_integrators(teacher: httpx.Client) -> None:
    target = {"quiz": "small", "lab": "five"}
    run = teacher.post(RUN, json={**target, "controls": {"timestep": 0.005}}).json()
    assert run["timestep"] == 0.005
    assert [integrator["name"] for integrator in run["integrators"]] == [
        "Euler",
        "RK4",
        "implicit",
        "implicitfast",
        "discrete",
    ]
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
