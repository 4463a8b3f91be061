"""What has passed is not checked again, until anything changes that it depends on; what failed always is."""

import json
import os
import shutil
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any

import pytest

from grader.certify.keys import certify_quizzes, find_refused_keys
from grader.errors import Fault, NotFound
from grader.exercises import GROUP, TextOf
from grader.library import PassedChecks, load
from grader.library.checking import passed
from grader.library.checking.passed import AGE_S, digest_code, list_code
from grader.library.checking.semantics import _part_faults
from support.sites import ROOT

LESSON = Path(os.environ["GRADER_CONTENT"])


@dataclass
class Counted:
    """A check that counts how often it runs, and reads the files that it is told to."""

    result: list[str] = field(default_factory=list)
    files: tuple[str, ...] = ()
    runs: int = 0

    def __call__(self, text_of: TextOf) -> list[str]:
        self.runs += 1
        for path in self.files:
            try:
                text_of(path)
            except NotFound:
                self.result = []
        return self.result


def run(checks: PassedChecks, check: Counted, *inputs: str, texts: dict[str, str] | None = None) -> list[str]:
    def text_of(path: str) -> str:
        if path not in (texts or {}):
            raise NotFound(f"There is no {path}.")
        return (texts or {})[path]

    return checks.run(
        "counted", inputs, check, text_of=text_of, write=lambda found: None if "bad" in found else found, read=list
    )


@pytest.fixture
def checks(tmp_path: Path) -> PassedChecks:
    return PassedChecks(tmp_path / "cache")


def test_what_passed_runs_once_also_for_another_process(checks: PassedChecks) -> None:
    check = Counted(["fine"])
    assert [run(checks, check, "a", "b") for _ in range(3)] == [["fine"]] * 3
    assert run(PassedChecks(checks.folder), check, "a", "b") == ["fine"]
    assert check.runs == 1


def test_what_failed_runs_each_time(checks: PassedChecks) -> None:
    check = Counted(["bad"])
    assert [run(checks, check, "a") for _ in range(3)] == [["bad"]] * 3
    assert check.runs == 3


def test_other_inputs_are_another_check(checks: PassedChecks) -> None:
    check = Counted()
    for inputs in (("ab", "c"), ("a", "bc"), ("abc",), ("a", "b", "c")):
        run(checks, check, *inputs)
    assert check.runs == 4


def test_a_file_that_changed_appeared_or_went_is_checked_again(checks: PassedChecks) -> None:
    check = Counted(files=("x.py", "y.py"))
    one = {"x.py": "1"}
    for texts, runs in ((one, 1), (one, 1), ({"x.py": "2"}, 2), (one | {"y.py": "1"}, 3), (one | {"y.py": "1"}, 3)):
        run(checks, check, texts=texts)
        assert check.runs == runs


def test_a_broken_entry_is_computed_and_written_again(checks: PassedChecks) -> None:
    check = Counted(["fine"])
    run(checks, check)
    assert checks.place is not None
    (entry,) = checks.place.iterdir()
    entry.write_bytes(entry.read_bytes()[:9])
    assert [run(checks, check) for _ in range(2)] == [["fine"]] * 2
    assert check.runs == 2


def test_a_folder_that_cannot_be_used_only_costs_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_text("")
    at = (PassedChecks(), PassedChecks(tmp_path / "file"))
    monkeypatch.setattr(os, "geteuid", lambda: 12345)
    for checks in (*at, PassedChecks(tmp_path / "another user's")):
        check = Counted(["fine"])
        assert [run(checks, check) for _ in range(2)] == [["fine"]] * 2
        assert check.runs == 2
        assert checks.place is None


def test_results_of_versions_that_nobody_uses_are_removed(tmp_path: Path) -> None:
    ages = {"old": AGE_S + 60, "recent": AGE_S - 60}
    for name, age_s in ages.items():
        (tmp_path / name).mkdir()
        os.utime(tmp_path / name, (time.time() - age_s,) * 2)
    checks = PassedChecks(tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {"recent", digest_code()}
    assert checks.place == tmp_path / digest_code()


def test_the_digest_covers_our_code_and_that_of_plug_ins(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    ours = set(list_code())
    assert ours >= set((ROOT / "src" / "grader" / "certify").glob("*.py"))
    (tmp_path / "plugged_in.py").write_text("x = 1\n")
    monkeypatch.syspath_prepend(tmp_path)
    other = EntryPoint("other", "plugged_in:Kind", GROUP)
    monkeypatch.setattr(passed, "find_points", lambda group: [other] if group == GROUP else [])
    assert set(list_code()) == ours | {tmp_path / "plugged_in.py"}


def test_a_lesson_is_the_same_with_and_without(checks: PassedChecks, monkeypatch: pytest.MonkeyPatch) -> None:
    def derive(passed_before: PassedChecks) -> list[Any]:
        library = load(LESSON, passed=passed_before)
        certificates = [certified.certificate for certified in certify_quizzes(library, library.quizzes, passed_before)]
        told = [certificate and certificate.to_json() | {"cost_ms": 0} for certificate in certificates]
        return [library.digests, library.texts, library.warnings, library.sources, told]

    cold, first = derive(PassedChecks()), derive(checks)
    checked = "library.checking.semantics._part_faults", "certify.keys.certify_key", "library.loading.prose_warnings"
    for name in (f"grader.{function}" for function in checked):
        monkeypatch.setattr(name, lambda *_: pytest.fail("what has passed is computed again"))
    assert cold == first == derive(checks)


@pytest.fixture
def content(tmp_path: Path) -> Path:
    for name in ("quizzes", "models"):
        shutil.copytree(LESSON / name, tmp_path / "content" / name)
    return tmp_path / "content"


def edit(file: Path, change: Callable[[Any], None]) -> None:
    quiz = json.loads(file.read_text())
    change(quiz)
    file.write_text(json.dumps(quiz))


def test_a_false_key_and_a_broken_lab_are_refused_after_all_has_passed(
    checks: PassedChecks, content: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    library = load(content, passed=checks)
    assert not list(find_refused_keys(library, library.quizzes, checks))
    file = content / "quizzes" / "1.3-check.json"
    numeric = next(n for n, one in enumerate(json.loads(file.read_text())["questions"]) if one["kind"] == "numeric")
    edit(file, lambda quiz: quiz["questions"][numeric].update(answer=3.0))
    library = load(content, passed=checks)
    for _ in range(2):
        (refused,) = find_refused_keys(library, library.quizzes, checks)
        assert refused.key.endswith("answer")
    tried: list[Any] = []

    def try_part(part: Any, *rest: Any) -> Iterator[Fault]:
        tried.append(part)
        return _part_faults(part, *rest)

    monkeypatch.setattr("grader.library.checking.semantics._part_faults", try_part)
    model = content / "models" / "pendulum_servo.xml"
    model.write_text(model.read_text().replace("<mujoco", "<!-- another --><mujoco", 1))
    load(content, passed=checks)
    assert {part.id for part in tried} >= {"servo-threshold"}
    assert len(tried) < sum(len(quiz.questions) + len(quiz.labs) for quiz in library.quizzes.values())
