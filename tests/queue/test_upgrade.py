"""Jobs that wait while the service is upgraded keep their turns."""

import json

from sqlalchemy import text

from grader.queue import jobs
from grader.store.engine.database import Database


def test_waiting_jobs_survive_the_change_of_their_table(url: str) -> None:
    database = Database(url)
    database.migrate("0003")
    with database.engine.begin() as connection:
        for number, user in enumerate(("ann", "ann", "bob")):
            connection.execute(
                text(
                    'INSERT INTO submissions (id, course, "user", quiz, question, answer, content_digest, status,'
                    " attempt, uses_attempt, revision, version, created_at) VALUES"
                    " (:id, 'c', :user, 'quiz', 'q', :answer, 'd', 'queued', 1, :yes, 0, 1, CURRENT_TIMESTAMP)"
                ),
                {"id": f"s{number}", "user": user, "answer": json.dumps("x"), "yes": True},
            )
            connection.execute(
                text("INSERT INTO jobs (topic, subject, tries, due_at) VALUES ('grade', :id, 0, CURRENT_TIMESTAMP)"),
                {"id": f"s{number}"},
            )
    database.migrate()
    taken = []
    for _ in range(4):
        with database.write() as session:
            claimed = jobs.claim(session, owner=1)
            taken.append(claimed.subject if claimed else None)
    assert taken == ["s0", "s2", "s1", None]
    database.close()
