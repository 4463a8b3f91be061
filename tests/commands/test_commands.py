"""The command line: exit codes, one JSON document, helpful errors."""

import json
import shutil
import socket
import subprocess
import sys
from datetime import UTC, datetime
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from sqlalchemy.orm import Session
from typer.main import get_group

from grader.commands.main import cli, find_commands
from grader.courses.people.identity import DEFAULT_COURSE
from grader.domain.policy import Extension
from grader.store import extensions, people
from grader.store.engine.database import Database
from grader.studies.bench import STUDIES
from support import command_line

ROOT = Path(__file__).parents[2]
GRADER = Path(sys.executable).parent / "grader"


def grader(*arguments: str, content: Path = ROOT) -> subprocess.CompletedProcess[str]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("GRADER_CONTENT", str(content))
        return command_line.grader(*arguments)


def verdict_of(*arguments: str) -> tuple[int, dict[str, Any]]:
    done = grader("grade", "1.3-check", *arguments, "--json") if "--" not in arguments else grader(*arguments)
    assert done.stdout, done.stderr
    return done.returncode, json.loads(done.stdout)


@pytest.mark.parametrize(
    ("module", "unneeded"),
    [
        ("grader.commands.main", {"mujoco", "numpy", "scipy", "pydantic", "sqlalchemy", "structlog"}),
        ("grader.service.accounts", {"mujoco", "numpy", "scipy", "fastapi", "alembic", "psycopg", "pint"}),
        ("grader.grading.processes", {"mujoco", "numpy", "pydantic", "sqlalchemy", "fastapi"}),
        ("grader.service.processes", {"mujoco", "numpy", "sqlalchemy", "fastapi", "uvicorn"}),
        ("grader.grading.process_main", {"scipy", "pint", "sqlalchemy", "fastapi"}),
    ],
)
def test_a_command_imports_what_it_needs(module: str, unneeded: set[str]) -> None:
    code = f"import sys, {module}; print(*sorted({unneeded!r} & sys.modules.keys()))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []


@pytest.fixture(scope="module")
def started() -> dict[str, list[str]]:
    """Of a server that is imported: modules that it does not need, complete responses, and built routes."""
    code = """
import json, sys
from fastapi.routing import APIRoute
built = []
populate = APIRoute.__init__
APIRoute.__init__ = lambda route, path, *args, **options: (built.append(path), populate(route, path, *args, **options))
import grader.service.app
from grader.api.bodies import ResponseBody
unneeded = {"scipy", "pint", "alembic", "psycopg", "matplotlib", "httpx2", "joserfc", "authlib", "latex2mathml"}
unneeded |= {"grader.certify.proposals"}
complete = [one.__name__ for one in ResponseBody.__subclasses__() if one.__pydantic_complete__]
print(json.dumps({"unneeded": sorted(unneeded & sys.modules.keys()), "complete": complete, "built": built}))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    modules: dict[str, list[str]] = json.loads(done.stdout)
    return modules


def test_a_server_imports_what_it_needs(started: dict[str, list[str]]) -> None:
    assert started["unneeded"] == []


def test_a_server_starts_without_the_models_of_its_responses(started: dict[str, list[str]]) -> None:
    assert started["complete"] == ["Page"]  # the base of pages of each kind


def test_a_server_starts_with_no_route_built(started: dict[str, list[str]]) -> None:
    assert started["built"] == []


def test_a_command_is_built_without_the_others_and_any_other_argument_has_all() -> None:
    every = get_group(cli).commands
    for name, command in every.items():
        built = get_group(find_commands([name, "--help"])).commands[name]
        assert (built.help, [param.opts for param in built.params]) == (
            command.help,
            [param.opts for param in command.params],
        )
    assert get_group(find_commands(["grade", "1.3-check"])).commands.keys() == {"grade", "grade-notebook"}
    for arguments in ([], ["--help"], ["grad"], ["--version", "grade"]):
        assert get_group(find_commands(arguments)).commands.keys() == every.keys()


def test_grading_a_choice_imports_nothing_that_it_does_not_need() -> None:
    code = """
import atexit, sys
from grader.commands.main import main
unneeded = {"scipy", "pint", "sqlalchemy", "alembic", "fastapi", "uvicorn", "psycopg", "prometheus_client"}
unneeded |= {"markdown_it", "yaml", "latex2mathml"}
unneeded |= {f"grader.{room}" for room in ("exercises", "certify", "experiments")}
atexit.register(lambda: print("unneeded:", *sorted(unneeded & sys.modules.keys())))
sys.argv[1:] = ["grade", "1.3-check", "q1", "1"]
main()
"""
    done = subprocess.run([sys.executable, "-c", code], check=False, capture_output=True, text=True, cwd=ROOT)
    assert (done.returncode, done.stdout.splitlines()[-1].strip(), done.stderr) == (0, "unneeded:", "")


def test_seconds_are_converted_to_the_unit_asked_for() -> None:
    code, verdict = verdict_of("q2", "0.005 s")
    assert (code, verdict["status"], verdict["read_as"]) == (0, "correct", "5 ms")


def test_seconds_without_a_unit_are_told_that_milliseconds_were_asked_for() -> None:
    code, verdict = verdict_of("q2", "0.005")
    assert (code, verdict["status"]) == (1, "incorrect")
    assert "milliseconds" in verdict["diagnosis"]


def test_a_negative_answer_goes_after_two_dashes() -> None:
    code, verdict = verdict_of("grade", "--json", "1.3-check", "q2", "--", "-5")
    assert (code, verdict["status"]) == (1, "incorrect")
    assert verdict["read_as"] == "-5 ms"


@pytest.mark.parametrize(
    "arguments",
    [
        ["grade", "1.3-check", "q99", "1"],
        ["grade", "nowhere", "q1", "1"],
        ["grade", "1.3-exercises", "servo-threshold", "no_such_file.py"],
        ["grade", "1.3-check"],
        ["no-such-command"],
        ["token", "create", "--user", "ada", "--role", "emperor"],
        ["token", "revoke"],
    ],
)
def test_usage_errors_exit_2_with_a_sentence_and_no_traceback(arguments: list[str]) -> None:
    done = grader(*arguments)
    assert done.returncode == 2
    assert done.stderr.strip()
    assert "Traceback" not in done.stderr
    assert not done.stdout


def test_check_of_a_folder_without_content_says_so() -> None:
    command = [str(GRADER), "check", "/nowhere/at/all"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "no content folder here" in done.stdout


@pytest.mark.parametrize(("name", "value"), [("PORT", "abc"), ("HOST", "0.0.0.0"), ("WORKERS", "-1")])
def test_a_setting_that_cannot_be_is_named(name: str, value: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(f"GRADER_{name}", value)
    done = grader("serve")
    assert done.returncode == 2
    assert "GRADER" in done.stderr and "Traceback" not in done.stderr


def test_a_source_that_is_not_utf8_or_too_long_exits_2(tmp_path: Path) -> None:
    for name, content in (("latin1.py", b"# \xe9\n"), ("long.py", b"#" * 300_000)):
        (tmp_path / name).write_bytes(content)
        assert grader("grade", "1.3-exercises", "servo-threshold", str(tmp_path / name)).returncode == 2


@pytest.mark.jail
def test_a_right_script_exits_0_and_a_wrong_one_1() -> None:
    folder = ROOT / "reference_solutions/1.3-exercises/servo-threshold"
    for status, code in (("correct", 0), ("incorrect", 1)):
        script = sorted(folder.glob(f"{status}__*.py"))[0]
        done = grader("grade", "1.3-exercises", "servo-threshold", str(script), "--json")
        assert json.loads(done.stdout)["status"] == status
        assert done.returncode == code


@pytest.mark.jail
def test_grade_prints_the_seed_that_repeats_the_verdict() -> None:
    script = str(ROOT / "reference_solutions/1.3-exercises/servo-threshold/correct__spectral_radius.py")

    def grade(*options: str) -> dict[str, Any]:
        done = grader("grade", "1.3-exercises", "servo-threshold", script, "--json", *options)
        verdict: dict[str, Any] = json.loads(done.stdout)
        return verdict

    first, other = grade(), grade()
    again = grade("--seed", str(first["seed"]))
    assert again["seed"] == first["seed"] != other["seed"]
    assert [finding["measured"] for finding in again["findings"]] == [f["measured"] for f in first["findings"]]
    assert again["evidence"] == first["evidence"]
    assert (
        f"--seed {first['seed']}"
        in grader("grade", "1.3-exercises", "servo-threshold", script, "--seed", str(first["seed"])).stdout
    )
    assert verdict_of("q2", "5 ms")[1]["seed"] is None


def test_reference_programs_that_cannot_be_read_are_faults_with_their_names(tmp_path: Path) -> None:
    folder = tmp_path / "reference_solutions/one/q1"
    for made in ("models", "quizzes", "reference_solutions/one/q1/correct__folder.py"):
        (tmp_path / made).mkdir(parents=True)
    (tmp_path / "quizzes/one.json").write_text(
        '{"id": "one", "title": "One", "questions": [{"kind": "numeric", "q": "?", "answer": 1}]}'
    )
    (folder / "correct__latin.py").write_bytes(b"# \xe9\n")
    (folder / "correct__long.py").write_bytes(b"#" * 300_000)
    (folder / "correct__link.py").symlink_to("nowhere.py")
    (folder / "._correct__link.py").write_bytes(b"\0\5")
    (folder / "correct__number.py").write_text("1")
    done = grader("check", "--json", content=tmp_path)
    assert done.returncode == 2
    told = {Path(fault["file"]).stem: fault["why"] for fault in json.loads(done.stdout)["faults"]}
    assert {name: why.split(":")[0] for name, why in told.items() if name != "correct__number"} == {
        "correct__folder": "is not a file of the content folder",
        "correct__latin": "is not UTF-8",
        "correct__link": "is not a file of the content folder",
        "correct__long": "is larger than 256 KB",
    }
    assert "correct__number" in told
    assert grader("check", content=tmp_path).stdout.count("reference_solutions/one/q1/") == 5


@pytest.mark.parametrize(
    ("answer", "accept", "code", "told_under"),
    [
        (9.81, None, 0, None),
        (19.62, None, 2, "faults"),
        (0.25, None, 1, "undecided"),
        (0.25, "Measured on the rig, see the lab book", 0, "warnings"),
    ],
)
def test_check_tells_certified_refuted_and_undecided_keys_apart(
    answer: float, accept: str | None, code: int, told_under: str | None, tmp_path: Path
) -> None:
    # Source: v = g t; and a force whose period is h/64, which every halving of h meets in the same phase.
    fall = 'gravity="9.81 0 0"'
    force = {"controller": "data.qfrc_applied[0] = Math.cos(2 * Math.PI * data.time / (1e-3 / 64))"}
    is_known = answer > 1
    xml = f"""<mujoco><option timestep="0.001" {fall if is_known else 'gravity="0 0 0"'}/><worldbody><body>
      <joint type="slide" axis="1 0 0"/><geom size=".1" mass="2"/></body></worldbody></mujoco>"""
    verify = {"by": "measurement", "xml": xml, "expr": f"data.{'qvel' if is_known else 'qpos'}[0]", "seconds": 1}
    verify |= ({} if is_known else force) | ({} if accept is None else {"accept": accept})
    unit = "m/s" if is_known else "m"
    question = {"id": "q1", "kind": "numeric", "q": "?", "answer": answer, "unit": unit, "tol": 0.01, "verify": verify}
    for folder in ("models", "quizzes"):
        (tmp_path / folder).mkdir()
    (tmp_path / "quizzes/one.json").write_text(json.dumps({"id": "one", "title": "One", "questions": [question]}))
    done = grader("check", "--json", content=tmp_path)
    report = json.loads(done.stdout)
    assert (done.returncode, report["ok"]) == (code, code == 0)
    for name in ("faults", "undecided", "warnings"):
        assert [fault["file"] for fault in report[name]] == ["quizzes/one.json"] * (name == told_under)
    verdict = {2: "refuted", 1: "cannot tell"}.get(code, "cannot tell" if accept else "certified")
    assert report["certificates"][0]["verdict"] == verdict
    if code == 1:
        assert "cannot tell: " in report["undecided"][0]["why"]
        assert report["undecided"][0]["why"].endswith("or write why the key holds as verify.accept")


@pytest.fixture
def broken_content(tmp_path: Path) -> Path:
    """A copy of the content with five faults planted."""
    for folder in ("quizzes", "models"):
        shutil.copytree(ROOT / folder, tmp_path / folder)
    path = tmp_path / "quizzes/1.3-check.json"
    quiz = json.loads(path.read_text())
    questions = quiz["questions"]
    questions[0]["answer"] = 4
    questions[1]["tol"] = -0.05
    questions[2]["sim"]["model"] = "pendulum_sevro"
    questions[3]["referense"] = questions[3].pop("reference")
    path.write_text(json.dumps(quiz))
    (tmp_path / "quizzes/broken.json").write_text('{"id": "broken", "title": ')
    return tmp_path


def test_check_names_every_fault_at_once(broken_content: Path) -> None:
    done = grader("check", "--json", content=broken_content)
    assert done.returncode == 2
    faults = json.loads(done.stdout)["faults"]
    told = [f"{fault['file']}: {fault['key']}: {fault['why']}" for fault in faults]
    for parts in (
        ("1.3-check.json", "q1", "answer"),
        ("1.3-check.json", "q2", "tol"),
        ("1.3-check.json", "q3", "pendulum_sevro"),
        ("1.3-check.json", "q4", "referense"),
        ("broken.json", "line 1"),
    ):
        assert [line for line in told if all(part in line for part in parts)], (parts, told)
    assert len(faults) == 5


def test_closed_standard_streams_are_opened_on_dev_null() -> None:
    program = ROOT / "reference_solutions/1.3-exercises/servo-threshold/correct__spectral_radius.py"
    command = f"exec {GRADER} grade 1.3-exercises servo-threshold {program} <&- 2>&-"
    done = subprocess.run(["sh", "-c", command], stdout=subprocess.PIPE, text=True, check=False, timeout=60)
    assert done.returncode == 0
    assert done.stdout.startswith("correct")


def test_an_extension_is_given_and_taken_back(tmp_path: Path) -> None:
    database = Database(f"sqlite:///{tmp_path / 'grader.db'}")

    def extend(*options: str) -> subprocess.CompletedProcess[str]:
        return grader("extend", "1.3-check", "--user", "ada", "--data", str(tmp_path), *options)

    def ada(session: Session) -> str:
        member = people.find_with_account(session, DEFAULT_COURSE, "name:ada")
        assert member is not None
        return member.id

    def kept() -> dict[str, Extension]:
        with database.read() as session:
            return extensions.list_of_learner(session, DEFAULT_COURSE, ada(session), ["1.3-check"])

    unknown = extend("--attempts", "1")
    assert (unknown.returncode, "has the name 'ada'" in unknown.stderr) == (2, True)
    assert grader("invite", "ada", "--data", str(tmp_path)).returncode == 0
    given = extend("--attempts", "1", "--due", "2026-10-26T18:00+01:00")
    assert (given.returncode, json.loads(given.stdout)["attempts"]) == (0, 1)
    assert kept() == {"1.3-check": Extension(attempts=1, due=datetime(2026, 10, 26, 17, tzinfo=UTC))}
    refused = extend("--due", "2026-10-26")
    assert (refused.returncode, refused.stderr.startswith("--due: ")) == (2, True)
    refused = extend("--due", "2026-10-26T18:00Z", "--until", "2026-10-25T18:00Z")
    assert (refused.returncode, "an until that is later" in refused.stderr) == (2, True)
    assert extend().returncode == 0
    assert kept() == {}
    database.close()


def test_who_erases_in_a_terminal_is_asked_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def erase(name: str, *options: str, typed: str = "") -> subprocess.CompletedProcess[str]:
        monkeypatch.setattr(sys, "stdin", command_line.Terminal(typed))
        return grader("erase", "--user", name, "--data", str(tmp_path), *options)

    assert all(grader("invite", name, "--data", str(tmp_path)).returncode == 0 for name in ("ada", "bob"))
    for typed in ("n\n", "\n"):
        kept = erase("ada", typed=typed)
        assert (kept.returncode, "Erase ada, " in kept.stdout + kept.stderr) == (1, True)
    assert erase("nobody").returncode == 2  # before a question
    assert erase("ada", typed="y\n").returncode == erase("bob", "--yes").returncode == 0
    assert erase("ada", "--yes").returncode == 2  # gone


def test_the_document_of_another_grader_has_the_same_exit_codes() -> None:
    for answer, code, failures in (("5 ms", 0, "0"), ("0.005", 1, "2")):
        done = grader("grade", "1.3-check", "q2", answer, "--format", "junit")
        assert (done.returncode, ElementTree.fromstring(done.stdout).attrib["failures"]) == (code, failures)
    done = grader("grade", "1.3-check", "q2", "0.005", "--format", "gradescope")
    assert (done.returncode, json.loads(done.stdout)["score"]) == (1, 0.0)
    refused = grader("grade", "1.3-check", "q2", "5 ms", "--format", "junit", "--json")
    assert (refused.returncode, refused.stdout) == (2, "")


def test_import_writes_what_is_sound_and_lists_the_faults_of_the_rest(tmp_path: Path) -> None:
    lesson = tmp_path / "7.md"
    lesson.write_text(
        '```quiz\n{"kind": "open", "q": "Why?"}\n```\n```lab simlab\n{"model": "m", "seconds": "3"}\n```\n'
    )
    done = grader("import", str(lesson), "--out", str(tmp_path / "quizzes"))
    assert done.returncode == 2
    assert [path.name for path in (tmp_path / "quizzes").iterdir()] == ["7-check.json"]
    assert "7: line 4: seconds: must be a valid number, not '3'" in done.stdout + done.stderr


@pytest.mark.parametrize("command", ["serve", "author"])
def test_a_port_in_use_is_one_line(command: str) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        done = grader(command, "--port", str(port))
    assert (done.returncode, done.stdout) == (3, "")
    assert done.stderr == (
        f"Port {port} of 127.0.0.1 cannot be opened (Address already in use): choose another with --port.\n"
    )


def test_a_content_folder_that_is_not_there_is_one_line(tmp_path: Path) -> None:
    done = grader("grade", "1.3-check", "q1", "1", content=tmp_path / "nowhere")
    assert (done.returncode, done.stdout) == (2, "")
    told = f"quizzes: *.json: there is no folder {tmp_path}/nowhere (GRADER_CONTENT or GRADER_COURSES names it)"
    assert done.stderr.split() == told.split()


def test_the_help_of_bench_names_every_benchmark() -> None:
    text = grader("bench", "--help").stdout
    assert [name for name in STUDIES if name not in text] == []


def test_the_package_is_the_command_line_too() -> None:
    command = [sys.executable, "-m", "grader", "grade", "--help"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)
    assert done.returncode == 0, done.stderr
    assert "python -m grader grade" in done.stdout
