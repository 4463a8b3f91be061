"""Fair shares: a learner's next script waits for at most one of every other learner."""

import random
import time
from collections import defaultdict
from typing import Any

import pytest
from sqlalchemy import create_engine, event, insert
from sqlalchemy.orm import Session

from grader.queue import jobs
from grader.queue.jobs import JobRow
from grader.store.engine.database import Database

pytestmark = pytest.mark.slow


def put(database: Database, user: str, count: int = 1) -> None:
    with database.write(hasty=True) as session:
        for _ in range(count):
            jobs.put(session, "grade", user, share=user)


def take(database: Database) -> str | None:
    with database.write(hasty=True) as session:
        claimed = jobs.claim(session, owner=1)
        if claimed is None:
            return None
        jobs.finish(session, claimed)
        return claimed.subject


def test_ten_scripts_of_one_learner_make_another_wait_for_one(database: Database) -> None:
    put(database, "ann", 10)
    assert take(database) == "ann"
    put(database, "bob", 2)
    put(database, "eve")
    order = [take(database) for _ in range(6)]
    assert sorted(map(str, order[:3])) == ["ann", "bob", "eve"]
    assert sorted(map(str, order[3:5])) == ["ann", "bob"]
    assert order[5] == "ann"


def test_a_learner_who_hands_in_again_and_again_does_not_overtake_those_who_wait(database: Database) -> None:
    put(database, "ann", 5)
    order = []
    for _ in range(9):
        put(database, "bob")
        order.append(take(database))
    waits = "".join(str(user)[0] for user in order)
    assert "bbb" not in waits
    assert "aaa" not in waits
    assert waits.count("a") >= 4


@pytest.mark.parametrize("seed", range(4))
def test_in_any_history_the_next_script_waits_for_at_most_one_of_every_other_learner(
    database: Database, seed: int
) -> None:
    """Counts, while a learner's next script waits, how many scripts of each other learner are claimed before it."""
    draw = random.Random(seed)
    users = [f"user{number}" for number in range(6)]
    waiting: dict[str, int] = defaultdict(int)
    overtaken: dict[str, dict[str, int]] = {user: defaultdict(int) for user in users}
    for _ in range(150):
        if draw.random() < 0.5:
            user = draw.choice(users[: draw.randint(1, 6)])
            put(database, user)
            waiting[user] += 1
            continue
        served = take(database)
        if served is None:
            assert not any(waiting.values())
            continue
        waiting[served] -= 1
        overtaken[served].clear()
        for other in users:
            if other != served and waiting[other]:
                overtaken[other][served] += 1
                assert overtaken[other][served] <= 1, f"{served} went twice before {other}"


def test_a_job_that_is_tried_again_goes_first_and_lets_no_other_share_jump_ahead(database: Database) -> None:
    put(database, "ann", 3)
    with database.write() as session:
        failed = jobs.claim(session, owner=1)
        assert failed is not None
    for _ in range(2):
        assert take(database) == "ann"
    put(database, "ann", 3)
    assert take(database) == "ann"
    with database.write() as session:
        jobs.put_back(session, failed, 0.0, tried=True)
    put(database, "bob", 3)
    with database.write() as session:
        again = jobs.claim(session, owner=1)
        assert again is not None
        assert again.job_id == failed.job_id
    assert sorted(str(take(database)) for _ in range(2)) == ["ann", "bob"]


def test_a_claim_on_sqlite_reads_the_queue_in_its_order_and_sorts_nothing() -> None:
    engine = create_engine("sqlite://")
    jobs.QueueBase.metadata.create_all(engine)
    with engine.connect() as connection:
        first = jobs.FIRST.params({"from": 0, "to": 3, "topics": jobs.TOPICS})
        compiled = first.compile(connection, compile_kwargs={"literal_binds": True})
        explained = connection.exec_driver_sql(f"EXPLAIN QUERY PLAN {compiled}")
        assert [row[3] for row in explained] == ["SEARCH jobs USING INDEX ix_jobs_order (priority>? AND priority<?)"]


def test_what_a_waiting_learner_asks_searches_indices_on_sqlite() -> None:
    engine, plans = create_engine("sqlite://"), list[str]()
    jobs.QueueBase.metadata.create_all(engine)

    def explain(_engine: Any, cursor: Any, statement: str, parameters: Any, *_: Any) -> None:
        if "jobs" in statement and "INSERT" not in statement:
            plans.append(cursor.execute(f"EXPLAIN QUERY PLAN {statement}", parameters).fetchone()[3])

    with Session(engine) as session:
        jobs.put(session, "grade", "x", share="ann")
        event.listen(engine, "before_cursor_execute", explain)
        assert jobs.count_ahead(session, "x", "ann") == 0
        assert jobs.withdraw(session, "grade", "x", "ann")
    theirs = "SEARCH jobs USING INDEX ix_jobs_share (share=? AND priority=?)"
    earlier = "SEARCH jobs USING INDEX ix_jobs_order (priority=? AND (round,share)<(?,?))"
    assert plans == [theirs, earlier, theirs]


def test_a_claim_costs_the_same_in_a_queue_of_10_000(database: Database) -> None:
    """Paired: the fastest of claims and puts in a long queue beside that in a short one, on the same database. None
    waits for the disk, on which others may write."""

    def least_s() -> float:
        times = []
        for _ in range(21):
            begin = time.perf_counter()
            put(database, "bob")
            assert take(database)
            times.append(time.perf_counter() - begin)
        return min(times)

    put(database, "ann", 10)
    short_s = least_s()
    with database.write() as session:
        rows = [
            {"topic": "grade", "subject": "x", "share": jobs.hash_share(f"user{n % 500}"), "round": n // 500 + 2}
            for n in range(10_000)
        ]
        new = {"tries": 0, "priority": 0}
        session.execute(insert(JobRow), [{**row, **new} for row in rows])
    assert least_s() < 3 * short_s + 0.002
