"""The service's study measures the real server: every row that the page shows comes out of it."""

import pytest

from grader.studies.bench.service import answers, workers
from grader.studies.bench.service.answers import compare_with_bare
from grader.studies.bench.service.workers import Workers


@pytest.mark.slow
def test_answers_are_measured_beside_the_bare_route(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(answers, "LEARNERS", 10)
    found = compare_with_bare("sqlite", 2, 1, 0.3)
    assert found["submissions"] > 0
    assert found["ratio"] == pytest.approx(found["per_second"] / found["bare_per_second"])
    assert 0 < found["median_s"] <= found["p95_s"] <= found["p99_s"]


@pytest.mark.slow
def test_a_queue_is_worked_off_by_more_and_more_workers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(workers, "WORKER_COUNTS", (1, 2))
    found = Workers("empty").measure(True, {})
    assert [run["workers"] for run in found["runs"]] == [1, 2]
    assert found["runs"][0]["ratio"] == 1
    assert all(run["per_second"] > 0 and run["cores"] > 0 for run in found["runs"])
