"""docs/rest.md and docs/webhooks.md, word for word: their commands run, and print what the pages say."""

import json
import sys
from pathlib import Path

import pytest

from docs.shell_pages import ROOT, Printed, check_printed, find_blocks, fits, run_page
from grader.settings import Settings
from support.sites import open_site

DEAD_LETTERS = """
import sys
from grader.settings import Settings
from grader.store.engine.database import Database
from grader.store.outbox import DEAD, Delivery
from grader.store.tables import now

database = Database(Settings().database)
with database.write() as session:
    session.add_all(
        Delivery(
            destination=sys.argv[1], course="default", learner="0" * 32, quiz="1.3-check", question=question,
            state=DEAD, version=1, noted_at=now(), has_job=False, attempts=9, forced=False,
        )
        for question in ("q1", "q2")
    )
database.close()
"""
"""Two results that could not be delivered to a webhook."""


@pytest.fixture(scope="module")
def printed(tmp_path_factory: pytest.TempPathFactory) -> Printed:
    folder = tmp_path_factory.mktemp("rest")
    with open_site(Settings(content=ROOT, data=folder / "data", workers=0)) as site:
        return run_page("rest.md", site.origin, folder)


@pytest.mark.slow
def test_every_command_runs_and_prints_what_the_page_says(printed: Printed) -> None:
    assert check_printed(printed) == len([kind for kind, _ in find_blocks("rest.md") if kind != "sh"])


@pytest.mark.slow
@pytest.mark.parametrize("shell", ["bash", "zsh"])
def test_every_command_about_webhooks_runs_in_both_shells(shell: str, tmp_path: Path) -> None:
    (tmp_path / "dead_letters.py").write_text(DEAD_LETTERS)
    prepare = {0: f'"{sys.executable}" dead_letters.py "$WEBHOOK"'}
    with open_site(Settings(content=ROOT, data=tmp_path / "data", workers=0)) as site:
        ran = run_page("webhooks.md", site.origin, tmp_path, shell, prepare)
    assert check_printed(ran) == 2
    [replayed] = [output for command, output, _ in ran if "dead.json" in command]
    assert '"state":"waiting"' in replayed
    assert replayed.rstrip().endswith('{"replayed":1}')


@pytest.mark.slow
def test_the_exports_hold_the_learner(printed: list[tuple[str, str, str]]) -> None:
    outputs = {command: output for command, output, _ in printed}
    [roster] = [output for command, output in outputs.items() if 'roster.csv" -H' in command]
    assert "Ada Lovelace,ada@school.example,student,school,s1815" in roster
    [heading] = [output for command, output in outputs.items() if "moodle.csv" in command]
    assert heading.strip().startswith("Username,Email address,ID number,")


@pytest.mark.slow
def test_a_row_of_the_feed_has_the_fields_that_other_programs_rely_on(printed: list[tuple[str, str, str]]) -> None:
    [page] = [output for command, output, _ in printed if "results?limit=100" in command]
    [row] = json.loads(page)["items"]
    fixed = {"submission_id": str, "user": str, "quiz": str, "question": str, "points": float, "max_points": float,
             "revision": int}  # fmt: skip
    assert {name: type(row[name]) for name in fixed} == fixed
    assert (row["user"], row["learner"]) == ("Ada Lovelace", {"namespace": "school", "id": "s1815"})


def test_the_page_is_not_fitted_by_anything() -> None:
    assert fits({"a": [{"b": "..."}]}, {"a": [{"c": 1}, {"b": "x"}], "d": 1})
    for shown, actual in (({"a": 1}, {}), ({"a": 1}, {"a": 2}), ({"a": []}, {"a": [1]}), ({"a": "..."}, {"a": 1})):
        assert not fits(shown, actual)
