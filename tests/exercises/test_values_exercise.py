"""Values of functions: the content of tests/exercises/values, what counts, what is named, what an author may do."""

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from exercises.conftest import with_check
from grader.domain.run import RunReport, RunStatus
from grader.domain.verdict import Status, Verdict
from grader.errors import ContentError
from grader.exercises import judge_exercise, plan_exercise
from grader.exercises.kinds.values import parameters, rehearsal
from grader.exercises.kinds.values.parameters import Problem
from grader.exercises.programs import limit_lines
from grader.library import Library, load
from grader.questions.kinds.script import ScriptQuestion
from support import command_line

HERE = Path(__file__).parent
GRADER = Path(sys.executable).parent / "grader"
QUESTION: dict[str, Any] = {
    "kind": "code",
    "id": "two",
    "q": "Write two.",
    "entry": "two",
    "check": {
        "kind": "values",
        "program": "programs/two.py",
        "functions": [{"results": [{"name": "sum", "unit": "m"}, {"name": "product", "unit": "m2", "atol": 0.1}]}],
        "cases": [
            {"id": "seen", "arguments": [2, 3]},
            {"id": "unseen", "hidden": True, "arguments": [[1, 2], [3, 4]], "calls": 3},
        ],
    },
}
PROGRAM = "def two(a, b):\n    return a + b, a * b\n"


def folder(path: Path, program: str = PROGRAM, /, **changes: Any) -> Path:
    """A content folder with one exercise; `changes` are made in its check."""
    question = {**QUESTION, "check": {**QUESTION["check"], **changes}}
    (path / "quizzes").mkdir(exist_ok=True)
    (path / "programs").mkdir(exist_ok=True)
    (path / "programs/two.py").write_text(program)
    (path / "quizzes/q.json").write_text(json.dumps({"id": "q", "title": "Q", "questions": [question]}))
    return path


def exercise(library: Library) -> ScriptQuestion:
    exercise = library.question("q", "two")
    assert isinstance(exercise, ScriptQuestion)
    return exercise


def judged(library: Library, *calls: tuple[Any, ...] | None, seed: int = 1) -> Verdict:
    """The verdict on results of the visible call, then of the hidden ones; None for one that returned None."""
    plan = plan_exercise(exercise(library), library.model_xml, seed, library.text)
    results: dict[str, Any] = {}
    places = [(0, 0), (1, 0), (1, 1), (1, 2)]
    for (trial, call), given in zip(places, calls, strict=True):
        if given is None:
            results[f"t{trial}_other{call}"] = np.frombuffer(b"None", dtype=np.uint8)
            continue
        for position, value in enumerate(given):
            results[f"t{trial}_r{call}_{position}"] = np.array(value, dtype=np.float64)
    return judge_exercise(
        exercise(library), plan, RunReport(RunStatus.RETURNED, results=results, hidden_results=results)
    )


def right(library: Library, seed: int = 1) -> list[tuple[Any, ...]]:
    plan = plan_exercise(exercise(library), library.model_xml, seed, library.text)
    pairs = [call.arguments for trial in plan.trials for call in trial.problem.calls]
    return [(a + b, a * b) for a, b in pairs]


@pytest.fixture
def library(tmp_path: Path) -> Library:
    return load(folder(tmp_path))


def test_the_test_content_holds() -> None:
    done = command_line.grader("check", str(HERE / "values"), "--json")
    assert done.returncode == 0, done.stdout
    statuses = [reference["got"] for reference in json.loads(done.stdout)["references"]]
    assert len(statuses) >= 20
    assert statuses.count("correct") == 3


def test_right_results_are_right_and_tolerances_count(library: Library) -> None:
    assert judged(library, *right(library)).status is Status.CORRECT
    near = [(a * (1 + 9e-10), b + 0.09) for a, b in right(library)]
    assert judged(library, *near).status is Status.CORRECT
    assert judged(library, *[(a * (1 + 3e-9), b) for a, b in right(library)]).status is Status.INCORRECT
    assert judged(library, *[(a, b + 0.12) for a, b in right(library)]).status is Status.INCORRECT


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        (lambda a, b: (b, a), "wrong order"),
        (lambda a, b: (-a, b), "sum has the wrong sign"),
        (lambda a, b: (a, b * 2), "product is twice"),
        (lambda a, b: (a / 2, b), "sum is half"),
        (lambda a, b: (np.rad2deg(a), b), "sum is in degrees"),
        (lambda a, b: (a, 1000 * b), "product is 1000 times too large"),
        (lambda a, b: ([a], b), "wrong shape"),
        (lambda a, b: (5.0, 6.0), "same results for every call"),
        (lambda a, b: None, "returns None"),
        (lambda a, b: (1.7e308, -1.7e308), "same results for every call"),
    ],
)
def test_a_mistake_is_named(library: Library, wrong: Any, sentence: str) -> None:
    verdict = judged(library, *[wrong(*pair) for pair in right(library)])
    assert sentence in (verdict.diagnosis or "")


def test_a_reference_that_does_not_end_for_other_arguments_explains_nothing(tmp_path: Path) -> None:
    """Mistakes are looked for by calling it with arguments that its author has not foreseen, such as 0."""
    counts_up = "def two(a, b):\n    x = 0\n    while not x >= 1:\n        x += a / 1000\n    return a + b, a * b\n"
    library = load(folder(tmp_path, counts_up))
    verdict = judged(library, *[(a + 0.123456, b - 0.3) for a, b in right(library)])
    assert verdict.status is Status.INCORRECT


NEVER_ENDS = """
def two(a, b):
    while True:
        try:
            1 / 0
        except Exception:
            a += 1
"""


def test_a_program_that_calls_exit_is_a_fault_and_ends_nothing(tmp_path: Path) -> None:
    with pytest.raises(ContentError, match=r"cases\.0: .*: it calls exit\(\): return a result"):
        load(folder(tmp_path, "def two(a, b):\n    raise SystemExit(0)\n"))


def test_a_program_that_does_not_end_is_a_fault(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rehearsal, "limit_lines", partial(limit_lines, lines_max=1_000))
    before = sys.gettrace()
    with pytest.raises(ContentError, match=r"cases\.0: .*: it runs more than 1,000 lines: bound its loops"):
        load(folder(tmp_path, NEVER_ENDS))
    assert sys.gettrace() is before
    assert limit_lines(lambda: sum(1 for _ in range(2_000)), 1_000) == 2_000, "lines of others do not count"


@pytest.mark.parametrize(
    ("body", "told"),
    [
        ("    while s > 0:\n        s += 1\n", "what remains when they are put into it does not end for them in time."),
        ("    assert s < 0\n", "what remains when they are put into it cannot be computed for them."),
        (
            "    return float('nan') if s > 0 else 0.0\n",
            "what remains when they are put into it cannot be computed for them.",
        ),
    ],
)
def test_a_residual_that_cannot_be_computed_for_results_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, body: str, told: str
) -> None:
    monkeypatch.setattr(parameters, "limit_lines", partial(limit_lines, lines_max=1_000))
    functions = [{"results": [{"name": "s", "atol": 1}, {"name": "p"}], "residual": {"function": "missed", "atol": 1}}]
    program = f"{PROGRAM}\n\ndef missed(a, b, s, p):\n{body}    return 0.0\n"
    library = load(folder(tmp_path, program, functions=functions, luck=1))
    verdict = judged(library, *right(library))
    assert verdict.findings[0].message.startswith("Your results do not satisfy the exercise's own equation: ")
    assert told in verdict.findings[0].message
    assert "shape" not in verdict.model_dump_json()


@pytest.mark.parametrize("title", [None, "the gap"])
def test_of_a_residual_its_title_is_told_and_never_the_name_of_the_function(tmp_path: Path, title: str | None) -> None:
    residual = {"function": "solves", "atol": 1e-9, **({"title": title} if title else {})}
    library = load(folder(tmp_path, SOLVES, functions=[{**BY_RESIDUAL[0], "residual": residual}]))
    text = judged(library, *[(1.0, 2.0)] * 4).model_dump_json()
    assert f"{title or 'what remains when they are put into it'} should be 0 for them. Put the results" in text
    assert "solves" not in text


@pytest.mark.parametrize("given", ["(Decimal('5'), Decimal('6'))", "{'sum': Decimal('5'), 'product': Decimal('6')}"])
def test_exact_numbers_are_told_to_be_converted(library: Library, given: str) -> None:
    results = {"t0_other0": np.frombuffer(given.encode(), np.uint8)}
    plan = plan_exercise(exercise(library), library.model_xml, 1, library.text)
    verdict = judge_exercise(exercise(library), plan, RunReport(RunStatus.RETURNED, results=results))
    told = "The function must return sum, product as finite numbers: convert each Decimal by float(...) before you"
    assert verdict.findings[0].message.startswith(told)


def test_of_hidden_calls_no_number_is_told(library: Library) -> None:
    first, *others = right(library)
    verdict = judged(library, first, *[(a + 0.123456, b) for a, b in others])
    hidden = verdict.findings[1]
    assert (verdict.status, hidden.measured, hidden.expected) == (Status.PARTIAL, None, None)
    assert hidden.message == "sum is wrong."
    text = verdict.model_dump_json()
    assert not any(f"{value:.4g}" in text for pair in others for value in pair)
    assert {row["case"] for row in verdict.evidence["values"]} == {"seen"}


def test_a_visible_call_is_told_with_its_unit(library: Library) -> None:
    verdict = judged(library, (5.5, 6.0), *right(library)[1:])
    assert "In call 1: sum is off by 0.5 m; 5e-09 m is allowed." in verdict.findings[0].message
    assert verdict.findings[0].expected == {"sum": 5.0, "product": 6.0}


@pytest.mark.parametrize(
    "results",
    [
        {"t0_r0_0": np.array(["x"])},
        {"t0_r0_0": np.array([np.nan]), "t0_r0_1": np.array(1.0)},
        {"t0_r0_0": np.zeros((3, 2)), "t0_r0_1": np.zeros(0)},
        {"t0_other0": np.array([1.5, np.inf]), "t0_printed0": np.array(["yes"])},
        {"t0_r0_0": np.zeros(2, dtype=np.int64), "t0_r0_1": np.zeros(2, dtype=bool)},
    ],
)
def test_forged_results_are_a_wrong_answer_and_never_a_fault(library: Library, results: dict[str, Any]) -> None:
    plan = plan_exercise(exercise(library), library.model_xml, 1, library.text)
    verdict = judge_exercise(
        exercise(library), plan, RunReport(RunStatus.RETURNED, results=results, hidden_results=results)
    )
    assert (verdict.status, verdict.points) == (Status.INCORRECT, 0)


SOLVES = "def solves(a, b, sum, product):\n    return (sum - a - b) * (product - a * b)\n"
BY_RESIDUAL = [{"results": [{"name": "sum"}, {"name": "product"}], "residual": {"function": "solves", "atol": 1e-9}}]


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ((0,), (0,)),
        ((), (0,)),
        ((0, 3), (0, 3)),
        ((5000, 1), (1, 5000)),
        ((1, 5000), (5000, 1)),
        ((1,), (1,)),
        ((1, 1), ()),
        ((), (1, 1, 1)),
    ],
)
def test_a_residual_is_computed_of_results_of_the_declared_shapes_alone(
    first: tuple[int, ...], second: tuple[int, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    library = load(folder(tmp_path, SOLVES, functions=BY_RESIDUAL))
    assert judged(library, *right(library)).status is Status.CORRECT
    monkeypatch.setattr(Problem, "compute_remainder", lambda *_: pytest.fail("something was computed"))
    verdict = judged(library, *[(np.zeros(first), np.zeros(second))] * 4)
    assert (verdict.status, verdict.points) == (Status.INCORRECT, 0)
    assert "has the wrong shape" in verdict.findings[0].message


def test_a_shape_may_name_arguments(tmp_path: Path) -> None:
    results = [{"name": "rows", "shape": ["argument 1", "argument 2", 2]}]
    residual = {"function": "solves", "atol": 1e-9}
    cases = [{"id": "a", "arguments": [{"integer": 3}, {"array": [1, 2]}]}]
    functions = [{"results": results, "residual": residual}]
    program = "def solves(a, b, rows):\n    return rows\n"
    library = load(folder(tmp_path, program, functions=functions, cases=cases))
    plan = plan_exercise(exercise(library), library.model_xml, 1, library.text)
    assert [plan.trials[0].problem.list_shapes(call) for call in plan.trials[0].problem.calls] == [[(3, 2, 2)]]


def test_a_call_without_results_says_what_to_return(library: Library) -> None:
    plan = plan_exercise(exercise(library), library.model_xml, 1, library.text)
    verdict = judge_exercise(exercise(library), plan, RunReport(RunStatus.RETURNED))
    assert verdict.findings[0].message.startswith("The function must return sum, product as finite numbers.")


def test_a_wrong_program_of_the_author_names_its_mistake_first(tmp_path: Path) -> None:
    folder(tmp_path, mistakes=[{"program": "programs/minus.py", "sentence": "You subtract."}])
    (tmp_path / "programs/minus.py").write_text("def two(a, b):\n    return a - b, a * b\n")
    library = load(tmp_path)
    plan = plan_exercise(exercise(library), library.model_xml, 1, library.text)
    pairs = [call.arguments for trial in plan.trials for call in trial.problem.calls]
    assert judged(library, *[(a - b, a * b) for a, b in pairs]).diagnosis == "You subtract."


def test_rows_one_step_late_are_named(tmp_path: Path) -> None:
    program = "import numpy as np\ndef two(a, b):\n    return a * np.arange(5.0) ** 2, b\n"
    library = load(folder(tmp_path, program))
    plan = plan_exercise(exercise(library), library.model_xml, 1, library.text)
    pairs = [call.arguments for trial in plan.trials for call in trial.problem.calls]
    late = [(a * np.arange(1.0, 6.0) ** 2, b) for a, b in pairs]
    assert "sum is off by one step" in (judged(library, *late).diagnosis or "")


SLED = {
    "id": "a",
    "arguments": [1, 2],
    "xml": "<mujoco><worldbody><body><joint type='slide'/><geom size='1' mass='1'/></body></worldbody></mujoco>",
}
MASS: dict[str, Any] = {"numbers": {"mass": {"element": "body/geom", "attribute": "mass"}}}
UNSEEDED = "import numpy as np\ndef two(a, b):\n    return a + 1e-6 * np.random.default_rng().random(), a * b\n"
SEEDED_ONCE = """
import numpy as np
rng = np.random.default_rng(1)
def two(a, b):
    return a + rng.random(), a * b
"""
COUNTS = "calls = []\ndef two(a, b):\n    calls.append(a)\n    return a + len(calls), a * b\n"
REMEMBERS = "sums = []\ndef two(a, b):\n    sums.append(a + b)\n    return sums[0], a * b\n"
NOISY = "import random\ndef solves(a, b, sum, product):\n    return sum - a - b + 1e-12 * random.random()\n"


@pytest.mark.parametrize(
    ("program", "changes", "key", "why"),
    [
        ("def two(a, b:\n", {}, "program", "SyntaxError"),
        ("def three(a):\n    return a\n", {}, "program", "defines no function two"),
        ("raise OSError('no disk')", {}, "program", "no disk"),
        ("def two(a, b):\n    return 1 / 0\n", {}, "cases.0", "ZeroDivisionError"),
        ("def two(a, b):\n    return a\n", {}, "cases.0", "sum, product"),
        (PROGRAM, {"program": "programs/none.py"}, "program", "programs/none.py"),
        (PROGRAM, {"program": "../two.py"}, "program", "stay inside"),
        (PROGRAM, {"mistakes": [{"program": "programs/no.py", "sentence": "So."}]}, "mistakes.0.program", "no.py"),
        (PROGRAM, {"cases": [{"id": "a", "function": "six", "arguments": [1, 2]}]}, "cases.0", "no function 'six'"),
        (PROGRAM, {"cases": [{"id": "a", "arguments": ["model", 2]}]}, "cases.0", "`model`"),
        (PROGRAM, {"functions": [{"results": [{"name": "sum", "rtol": 0}]}]}, "functions.0.results.0", "atol or rtol"),
        (SOLVES.replace("sum -", "sum[0] -"), {"functions": BY_RESIDUAL}, "cases.0", "declare `shape`"),
        (PROGRAM, {"functions": [{"results": [{"name": "a", "shape": [9999, 9999]}]}]}, "cases.0", "at most 10000"),
        ("def solves(*_):\n    return []\n", {"functions": BY_RESIDUAL}, "cases.0", "gives no numbers"),
        (PROGRAM, {"functions": [{"results": [{"name": "sum", "shape": [3]}]}]}, "cases.0", "not (3,)"),
        (
            "def two(a, b):\n    return [a + b], a * b\n",
            {},
            "cases.0",
            "sum of the author's program is an array of one",
        ),
        (
            "def two(a, b):\n    return a * 1e150, b\n",
            {},
            "cases.0",
            "sum of the author's program is as large as 2e+150",
        ),
        (
            PROGRAM,
            {"cases": [{**SLED, "start": {"qpos": [1, 2]}}]},
            "cases.0.start.qpos",
            "2 numbers; data.qpos of the",
        ),
        (PROGRAM, {"cases": [{**SLED, "set": {"mass": -1}}], **MASS}, "cases.0.set.mass", "with mass = -1 the model"),
        (
            PROGRAM,
            {
                "cases": [{**SLED, "set": {"mass": 1}}],
                "numbers": {"mass": {**MASS["numbers"]["mass"], "attribute": "m"}},
            },
            "numbers.mass.attribute",
            "unrecognized attribute: 'm'",
        ),
        (UNSEEDED, {}, "cases.0", "two of the author's program gives other results when it is called again: let"),
        (SEEDED_ONCE, {}, "cases.0", "gives other results when it is called again"),
        (COUNTS, {}, "cases.0", "gives other results when it is called again"),
        (REMEMBERS, {}, "cases.1", "gives other results when it is called again"),
        (NOISY, {"functions": BY_RESIDUAL}, "cases.0", "solves of the author's program gives another residual"),
        (PROGRAM, {"functions": [{"results": [{"name": "a", "shape": ["argument 3"]}]}]}, "cases.0", "argument 3"),
    ],
)
def test_faults_of_an_author_are_told_at_their_key(
    tmp_path: Path, program: str, changes: dict[str, Any], key: str, why: str
) -> None:
    with pytest.raises(ContentError) as caught:
        load(folder(tmp_path, program, **changes))
    told = {fault.key: fault.why for fault in caught.value.faults}
    assert why in told[f"two.check.{key}"]


def test_a_unit_that_is_not_known_is_remarked_on(tmp_path: Path) -> None:
    functions = [{"results": [{"name": "sum", "unit": "metrs"}, {"name": "product", "unit": "m2"}]}]
    (remark,) = load(folder(tmp_path, functions=functions)).warnings
    assert remark.key == "two.check.functions.0.results.0.unit"
    assert remark.why.startswith("'metrs' is not a known unit: correct it")


def test_tex_in_the_sentence_of_a_mistake_is_remarked_on(tmp_path: Path) -> None:
    (tmp_path / "programs").mkdir()
    (tmp_path / "programs/wrong.py").write_text("def two(a, b):\n    return a, b\n")
    mistakes = [{"program": "programs/wrong.py", "sentence": "Add them: $a + b$."}]
    (remark,) = load(folder(tmp_path, mistakes=mistakes)).warnings
    assert (remark.key, "without $" in remark.why) == ("two.check.mistakes.0.sentence", True)


def test_a_changed_program_changes_the_digest(tmp_path: Path) -> None:
    before = load(folder(tmp_path)).digest("q")
    assert load(folder(tmp_path, PROGRAM + "\n# clearer\n")).digest("q") != before


def test_the_starter_of_a_field_without_model_is_a_fault(library: Library) -> None:
    functions = [{"results": [{"name": "angle", "field": "qpos"}]}]
    with pytest.raises(ValueError, match="give either `model`"):
        plan_exercise(with_check(exercise(library), functions=functions), library.model_xml, 1, library.text)


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A folder with the plug-in, as pip installs it, without a network."""
    source, target = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("target")
    shutil.copytree(HERE / "plugin", source, dirs_exist_ok=True)
    options = ["--quiet", "--no-index", "--no-deps", "--no-build-isolation", "--disable-pip-version-check"]
    subprocess.run([sys.executable, "-m", "pip", "install", *options, "--target", target, source], check=True)
    yield target


def grader(
    installed: Path, content: Path, *arguments: str, cwd: Path | None = None
) -> subprocess.CompletedProcess[str]:
    path = os.pathsep.join(filter(None, [str(installed), os.environ.get("PYTHONPATH")]))
    environment = {**os.environ, "GRADER_CONTENT": str(content), "PYTHONPATH": path}
    return subprocess.run([GRADER, *arguments], capture_output=True, text=True, check=False, env=environment, cwd=cwd)


def words(path: Path) -> Path:
    """A content folder with an exercise of the plug-in's kind, and two reference programs."""
    cases = [{"id": "abba", "word": "abbac"}, {"id": "a", "hidden": True}, {"id": "b", "hidden": True}]
    question: dict[str, Any] = {"kind": "code", "id": "turn", "q": "Turn it.", "entry": "turn"}
    question["check"] = {"kind": "exact-text", "cases": cases}
    references = path / "reference_solutions/words/turn"
    (path / "quizzes").mkdir()
    (path / "models").mkdir()
    references.mkdir(parents=True)
    (path / "quizzes/words.json").write_text(json.dumps({"id": "words", "title": "Words", "questions": [question]}))
    (references / "correct__slice.py").write_text("def turn(word):\n    return word[::-1]\n")
    diagnosis = "# diagnosis: You return the word as it is"
    (references / "incorrect__same.py").write_text(f"{diagnosis}\ndef turn(word):\n    return word\n")
    return path


def test_a_kind_of_another_package_checks_and_grades(installed: Path, tmp_path: Path) -> None:
    content = words(tmp_path)
    checked = grader(installed, content, "check", str(content), "--json")
    assert checked.returncode == 0, checked.stdout + checked.stderr
    assert [reference["got"] for reference in json.loads(checked.stdout)["references"]] == ["correct", "incorrect"]
    wrong = content / "reference_solutions/words/turn/incorrect__same.py"
    graded = grader(installed, content, "grade", "words", "turn", str(wrong), "--json")
    assert graded.returncode == 1
    verdict = json.loads(graded.stdout)
    assert verdict["findings"][0]["expected"] == "cabba"
    assert verdict["findings"][1]["expected"] is None  # the case is hidden, so the runner hides its trial
    assert [chart["case"] for chart in verdict["evidence"]["charts"]] == ["abba"]


def test_a_kind_of_another_package_begins_its_example(installed: Path, tmp_path: Path) -> None:
    for arguments in (("course", "words"), ("exercise", "exact-text", "1.1-words", "--in", "words")):
        made = grader(installed, tmp_path, "new", *arguments, cwd=tmp_path)
        assert made.returncode == 0, made.stderr
    right = tmp_path / "words/reference_solutions/1.1-words/exact-text/correct__example.py"
    assert right.read_text().startswith("def turn(word)")
    checked = grader(installed, tmp_path, "check", "words", cwd=tmp_path)
    assert checked.returncode == 0, checked.stdout + checked.stderr


def test_without_the_package_its_kind_is_told_to_be_unknown(tmp_path: Path) -> None:
    checked = grader(tmp_path, words(tmp_path), "check", str(tmp_path))
    assert checked.returncode == 2
    assert (
        "no kind of exercise is called 'exact-text'; use claims, controller, model, policy, rk4, threshold, values"
        in checked.stdout
    )


def test_a_kind_that_cannot_be_loaded_is_told_with_its_package(installed: Path, tmp_path: Path) -> None:
    broken = tmp_path / "broken"
    shutil.copytree(installed, broken)
    (broken / "exact_text.py").write_text("import no_such_module\n")
    graded = grader(broken, words(tmp_path), "grade", "words", "turn", str(tmp_path / "models"))
    assert "the exercise kind 'exact-text' (exact_text:ExactText) cannot be loaded" in graded.stderr
    assert "No module named 'no_such_module' (exact_text.py, line 1)" in graded.stderr
    assert "uninstall grader-exact-text" in graded.stderr
    assert (graded.returncode, "Traceback" in graded.stderr) == (3, False)


def test_two_packages_that_claim_one_name_are_refused(installed: Path, tmp_path: Path) -> None:
    again = tmp_path / "again"
    shutil.copytree(installed, again)
    (folder,) = again.glob("*.dist-info")
    folder.rename(again / "another_package-1.0.dist-info")
    metadata = again / "another_package-1.0.dist-info/METADATA"
    metadata.write_text(metadata.read_text().replace("grader-exact-text", "another-package"))
    content = words(tmp_path)
    both = grader(Path(f"{installed}{os.pathsep}{again}"), content, "check", str(content))
    assert both.returncode != 0
    assert "two installed packages provide the exercise kind 'exact-text'" in both.stdout + both.stderr


REACHING = """import numpy as np


def arguments(model, numbers, rng):
    angle = rng.uniform(-1, 1)
    return np.array([np.cos(angle), np.sin(angle)]), int(rng.integers(1, 9)), angle + 1
"""


def test_the_authors_program_makes_arguments_of_the_drawn_numbers_and_they_are_checked(tmp_path: Path) -> None:
    def declare(text: str) -> Library:
        cases = [{"id": "a", "hidden": True, "calls": 2, "arguments": {"program": "programs/made.py"}}]
        place = folder(tmp_path, "def two(target, n, x):\n    return target[0] * n, x\n", cases=cases)
        (place / "programs/made.py").write_text(text)
        return load(place)

    library = declare(REACHING)
    one, again, other = (
        [
            call.arguments
            for call in plan_exercise(exercise(library), library.model_xml, seed, library.text).trials[0].problem.calls
        ]
        for seed in (1, 1, 2)
    )
    assert one == again
    assert one[0] != one[1] != other[1]
    target, count, _ = one[0]
    assert np.hypot(*target) == pytest.approx(1)
    assert type(count) is int
    for text, why in {
        "x = 1": "defines no function arguments",
        "def arguments(model, numbers, rng):\n    return 1 / 0": "ZeroDivisionError",
        "def arguments(model, numbers, rng):\n    return 5": "must return a list, not int",
        "def arguments(model, numbers, rng):\n    return [1] * 21": "at most 20",
        "def arguments(model, numbers, rng):\n    return [float('nan')]": '"model" or "data", and has nan or inf',
        "def arguments(model):\n    return [1]": "makes arguments has the parameters (model, numbers, rng)",
        "def arguments(model, numbers, rng):\n    return [1, 'word']": "argument 2 of programs/made.py must be",
        "def arguments(model, numbers, rng):\n    return ['data']": "has no model",
        "def arguments(model, numbers, rng):\n    return [[0.0] * 10001]": "at most 10000",
    }.items():
        with pytest.raises(ContentError) as refused:
            declare(text)
        assert why in str(refused.value)
