"""`grader deliveries`: one line for each, whatever a receiver has answered."""

from contextlib import closing
from pathlib import Path

import pytest

from grader.store.engine.database import Database
from grader.store.outbox import DEAD, Delivery, add_webhook
from grader.store.tables import now
from support.command_line import grader

ANSWERS = ["404", "500: <html>\r\n  <body>\n\tBad\x1b[31m gateway\u2028" + "x" * 5000 + "\n</html>", None]


def test_each_delivery_is_one_line_with_the_beginning_of_the_reason(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("GRADER_DATA", str(tmp_path))
    with closing(Database(f"sqlite:///{tmp_path}/grader.db")) as database:
        database.migrate()
        with database.write() as session:
            made = add_webhook(session, "c", {"url": "https://hook.example", "secret": "s", "created_by": "tina"})
            session.add_all(
                Delivery(
                    destination=made.id, course="c", learner="0" * 32, quiz="quiz", question=f"q{number}", state=DEAD,
                    version=1, noted_at=now(), attempts=5, error=answer, has_job=False, forced=False,
                )
                for number, answer in enumerate(ANSWERS)
            )  # fmt: skip
    rows = [line.split("\t") for line in grader("deliveries").stdout.removesuffix("\n").split("\n")]
    assert [row[4:6] for row in rows] == [[f"quiz/q{number}", "5"] for number in range(3)]
    assert {row[7] for row in rows} == {"https://hook.example"}
    told = [row[6] for row in rows]
    assert (told[0], told[2]) == ("404", "")
    assert told[1].startswith("500: <html> <body> Bad [31m gateway xxx")
    assert (len(told[1]), told[1][-1]) == (200, "…")
