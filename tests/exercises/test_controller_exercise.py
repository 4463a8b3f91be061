"""Controllers in closed loop, through the real jail: every reference program gets its status and its diagnosis, and no
cheat finds what is hidden."""

import json
import shutil
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

from grader.domain.run import Job, Limits, RunReport
from grader.domain.verdict import Status, Verdict
from grader.exercises import plan_exercise
from grader.exercises.episodes.films import describe_end
from grader.exercises.episodes.simulating import Fault, Record
from grader.exercises.kinds.controller.driver import check_controls
from grader.exercises.kinds.controller.playing import read_answer
from grader.grading.films import record_films
from grader.grading.pipeline import Pipeline
from grader.grading.references import read_demand
from grader.library import load
from grader.questions.kinds.script import ScriptQuestion
from grader.sandbox.jail import Jail
from support.content import PASSED, load_content
from support.sites import ROOT

pytestmark = [pytest.mark.jail, pytest.mark.slow]

QUIZ = "3.1-exercises"
PROGRAMS = sorted((ROOT / "reference_solutions" / QUIZ).glob("*/*.py"))
CHEATS = sorted((Path(__file__).parent / "controller_cheats").glob("*.py"))
SEED = 7
LIMITS = Limits(cpu_s=4, wall_s=40)
"""Programs that hang end soon; the others use a second at most."""


@pytest.fixture(scope="module")
def pipeline() -> Iterator[Pipeline]:
    library = load_content(QUIZ)
    with Jail(library.root / "models", workers=2, allow_t2=True) as jail:

        def run(job: Job) -> RunReport:
            return jail.run(replace(job, limits=LIMITS))

        yield Pipeline(library, run)


@pytest.fixture(scope="module")
def short(pipeline: Pipeline, tmp_path_factory: pytest.TempPathFactory) -> Pipeline:
    """The exercise `altitude` with two episodes in its last case, where the number of episodes shows nothing."""
    folder = tmp_path_factory.mktemp("short")
    shutil.copytree(ROOT / "models", folder / "models")
    shutil.copytree(ROOT / "quizzes" / "starters", folder / "quizzes" / "starters")
    quiz = json.loads((ROOT / "quizzes" / f"{QUIZ}.json").read_text())
    quiz["questions"] = [question for question in quiz["questions"] if question["id"] == "altitude"]
    quiz["questions"][0]["check"]["cases"][-1]["episodes"] = 2
    (folder / "quizzes" / f"{QUIZ}.json").write_text(json.dumps(quiz))
    return Pipeline(load(folder, passed=PASSED), pipeline.run)


def grade(pipeline: Pipeline, question: str, source: str, seed: int = SEED) -> Verdict:
    return pipeline.grade(QUIZ, question, {"source": source}, seed)


@pytest.mark.parametrize("path", PROGRAMS, ids=lambda path: f"{path.parent.name}/{path.stem}")
def test_a_program_is_judged_and_named_as_expected(path: Path, pipeline: Pipeline) -> None:
    source = path.read_text()
    status, diagnosis = read_demand(source, path.stem.partition("__")[0])
    verdict = grade(pipeline, path.parent.name, source)
    assert verdict.status == status, verdict.diagnosis
    assert (diagnosis or "") in (verdict.diagnosis or "")


def test_there_are_enough_of_them() -> None:
    statuses = Counter(path.stem.partition("__")[0] for path in PROGRAMS)
    assert set(statuses) <= set(Status)
    assert statuses["correct"] >= 9
    assert statuses.total() - statuses["correct"] >= 25


@pytest.mark.parametrize("name", ["servo-arm", "cart-pole", "altitude"])
def test_the_starter_runs_and_earns_nothing(name: str, pipeline: Pipeline) -> None:
    starter = (ROOT / "quizzes" / "starters" / f"{name.replace('-', '_')}.py").read_text()
    verdict = grade(pipeline, name, starter)
    assert (verdict.status, verdict.points) == (Status.INCORRECT, 0)
    assert verdict.diagnosis


def test_two_limits_are_told_apart_by_their_sensors(pipeline: Pipeline) -> None:
    verdict = grade(pipeline, "cart-pole", (ROOT / "quizzes" / "starters" / "cart_pole.py").read_text())
    titles = [finding.title for finding in verdict.findings if "leans" in finding.title]
    assert [title.partition(": ")[2] for title in titles[:2]] == ["limits of cart", "limits of pole"]
    assert len(titles) == len(set(titles))


ARM = "def control(model, data, target):\n    return {}\n"
MAKE = "def make(model):\n    def act(t, o):\n        return {}\n    return act\n"


@pytest.mark.parametrize(
    ("question", "source", "law", "told"),
    [
        ("servo-arm", ARM, "40 * (target - data.qpos[0]) - 60 * data.qvel[0] + data.qfrc_bias[0]", "gain on rate is"),
        ("cart-pole", MAKE, "12 * o[0] + 80 * o[1] + 14 * o[2] + 200 * o[3]", "gain on pole_rate is"),
        ("altitude", MAKE, "9.81 + 12 * (o[2] - o[0]) - 60 * o[1]", "gain on climb is"),
        ("cart-pole", MAKE, "12 * o[1] + 80 * o[0] + 14 * o[2] + 16 * o[3]", "controls take pole for cart:"),
    ],
)
def test_one_gain_that_is_too_large_is_no_exchange(
    question: str, source: str, law: str, told: str, pipeline: Pipeline
) -> None:
    assert told in (grade(pipeline, question, source.format(law)).diagnosis or "")


def find_question(pipeline: Pipeline, name: str) -> ScriptQuestion:
    question = pipeline.library.question(QUIZ, name)
    assert isinstance(question, ScriptQuestion)
    return question


def test_nothing_hidden_is_among_what_enters_the_jail(pipeline: Pipeline) -> None:
    plan = plan_exercise(find_question(pipeline, "altitude"), pipeline.library.model_xml, SEED)
    for trial in plan.trials:
        assert trial.inputs["model"] == pipeline.library.model_xml("altitude")
        assert set(trial.inputs) == {"model", "form", "nu", "entry"}
    masses = [episode.scene.model.body_mass[1] for trial in plan.trials for episode in trial.problem.episodes]
    assert len(set(masses)) > 10


@pytest.mark.parametrize("path", CHEATS, ids=lambda path: path.stem)
def test_a_cheat_earns_nothing(path: Path, short: Pipeline) -> None:
    verdict = grade(short, "altitude", path.read_text())
    assert verdict.points == 0, verdict.diagnosis
    assert verdict.status in (Status.INCORRECT, Status.CRASHED, Status.TIMED_OUT)


FRAMES = """
import re, sys

def make(model):
    frame, mass = sys._getframe(), 0.0
    while frame is not None:
        for value in list(frame.f_locals.values()):
            if isinstance(value, dict) and "model" in value:
                mass = float(re.search(r'name="drone".*?mass="([0-9.]+)"', value["model"], re.S)[1])
        frame = frame.f_back
    return lambda t, seen: 9.81 * mass + 6 * (seen[2] - seen[0]) - 6 * seen[1]
"""


def test_the_frames_of_the_driver_hold_the_public_model_alone(short: Pipeline) -> None:
    """The script finds a mass: that of the model that it gets, not one of those that are simulated."""
    verdict = grade(short, "altitude", FRAMES)
    assert (verdict.status, verdict.points) == (Status.PARTIAL, 1), verdict.diagnosis
    reached = {finding.title.partition(":")[0] for finding in verdict.findings if finding.passed}
    assert reached == {"without a load, to 1 m"}


def test_a_whole_number_too_large_for_a_float_is_told_so() -> None:
    with pytest.raises(ValueError, match="a whole number that is too large for a float"):
        check_controls(10**400, 1)


def test_no_number_of_a_hidden_episode_is_printed_or_told(short: Pipeline) -> None:
    source = (
        "def make(model):\n    def act(t, seen):\n        print('target', seen[2])\n"
        "        if seen[2] not in (1.0, 5.0):\n            raise ValueError(f'target {seen[2]}')\n"
        "        return 9.81\n    return act\n"
    )
    verdict = grade(short, "altitude", source)
    assert set(verdict.stdout.split("\n")) <= {"target 1.0", "target 5.0", ""}
    hidden = [finding.message for finding in verdict.findings if "hidden" in finding.title]
    assert hidden[0] == "ValueError, in line 5 of your script."
    assert all(finding.measured is None for finding in verdict.findings if "hidden" in finding.title)


def test_a_hang_in_a_hidden_episode_tells_no_moment(short: Pipeline) -> None:
    source = (
        "def make(model):\n    def act(t, seen):\n        while seen[2] not in (1.0, 5.0):\n            pass\n"
        "        return 9.81\n    return act\n"
    )
    verdict = grade(short, "altitude", source)
    assert verdict.status is Status.TIMED_OUT
    assert "It was in hidden case 1." in (verdict.diagnosis or "")


def test_the_noise_and_the_numbers_repeat_with_the_seed(short: Pipeline) -> None:
    source = "def make(model):\n    return lambda t, seen: 9.81 + 12 * (seen[2] - seen[0]) - 8 * seen[1]\n"
    first, second = (grade(short, "altitude", source) for _ in range(2))
    assert first.findings == second.findings
    measured = [finding.measured for finding in first.findings if finding.measured is not None]
    assert np.isfinite(measured).all()
    assert len(measured) == 6


def test_an_exception_loses_its_own_episode_alone(pipeline: Pipeline) -> None:
    """Nine of ten are enough: one that raises is forgiven, and the program is right."""
    good = (ROOT / "reference_solutions" / QUIZ / "altitude" / "correct__weighs_the_load.py").read_text()
    assert good.count("def make(model):\n") == 1
    counting = "COUNT = [0]\n\n\ndef make(model):\n    COUNT[0] += 1\n    if COUNT[0] == 6:\n        raise ValueError\n"
    once = good.replace("def make(model):\n", counting)
    verdict = grade(pipeline, "altitude", once)
    assert verdict.status is Status.CORRECT, verdict.diagnosis


def test_a_visible_case_has_charts(short: Pipeline) -> None:
    source = "def make(model):\n    return lambda t, seen: 9.81\n"
    charts = grade(short, "altitude", source).evidence["motions"]
    assert [chart["case"] for chart in charts] == ["empty", "empty", "load", "load"]


def test_a_sensor_that_leaves_its_range_has_a_chart_with_the_limits(pipeline: Pipeline) -> None:
    source = "def make(model):\n    return lambda t, seen: 60 * seen[1] + 8 * seen[3]\n"
    verdict = grade(pipeline, "cart-pole", source)
    titles = [chart["title"] for chart in verdict.evidence["motions"] if chart["case"] == "moving"]
    assert titles == ["pole and target", "cart", "controls"]
    chart = next(chart for chart in verdict.evidence["motions"] if chart["title"] == "cart")
    assert chart["marks"] == [{"y": end, "label": f"limit {end} from 4.5 s"} for end in (-0.3, 0.3)]
    assert any(finding.direction == "The sensor cart leaves the range that is allowed." for finding in verdict.findings)


def test_a_verdict_has_the_film_of_what_the_controller_did(pipeline: Pipeline) -> None:
    source = "def make(model):\n    return lambda t, seen: 0.0\n"
    evidence = grade(pipeline, "cart-pole", source).evidence
    at = (QUIZ, "cart-pole")
    film, other = record_films(pipeline.library, at, SEED, {"evidence": evidence, "findings": []})
    (panel,) = film.panels
    assert film.caption == "A pole that leans by 0.1 rad: simulated to its end."
    assert other.title == "A cart away from home"
    assert other.panels[0].qpos[0] == pytest.approx([0.4, 0.06])
    assert film.end_s == pytest.approx(4.99)
    assert panel.qpos[0] == pytest.approx([0, 0.1])
    chart = evidence["motions"][0]["series"][0]
    hinge = np.interp(panel.times_s, chart["x"], chart["y"])
    tracked = panel.qpos[:, film.scene.model.joint("hinge").qposadr[0]]
    assert np.abs(hinge - tracked)[:-1].max() < 1e-3  # the chart ends a period earlier
    assert record_films(pipeline.library, (QUIZ, "altitude"), SEED, {"evidence": evidence}) == []
    for key, value in (("time_s", []), ("qpos", [[0.0]]), ("qpos", [[0.0], []]), ("episode", 7)):
        run = {**evidence["film"]["cases"][0]["runs"][0], key: value}
        lost = {"evidence": {"film": {"cases": [{"case": "lean", "runs": [run]}]}}}
        assert record_films(pipeline.library, at, SEED, lost) == []


def test_what_is_wrong_in_the_first_episode_already_is_no_leftover(pipeline: Pipeline) -> None:
    """With this seed the first hidden episode succeeds by chance, and no other."""
    source = (ROOT / "reference_solutions" / QUIZ / "cart-pole" / "partial__forgets_the_cart.py").read_text()
    diagnosis = grade(pipeline, "cart-pole", source, seed=5975763200289741).diagnosis
    assert diagnosis == "The controls do not depend on cart: add a term with a gain of its own."


def test_a_film_says_why_an_episode_ended_early() -> None:
    times = np.array([0.0, 0.01])
    fault = Fault("ZeroDivisionError: division by zero", 2, 1, 3, 0.02)
    ends: dict[str, dict[str, Any]] = {
        "": {},
        "ZeroDivisionError at 0.01 s": {"fault": fault},
        "blew up at 0.01 s": {"lost_at_s": 0.02},
        "ends at 0.01 s": {"is_over": True},
    }
    for told, how in ends.items():
        assert describe_end(Record(cast(Any, None), times, **how)) == told


def test_what_no_text_can_hold_is_replaced_in_what_a_controller_raised() -> None:
    assert read_answer(rb'X{"raised": "ValueError: \ud800", "line": 2}', 1) == ("ValueError: \ufffd", 2)
