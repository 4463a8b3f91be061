"""What a script costs against its bare function on the same trials: how long a learner waits, and where the CPU time
goes. Nothing of the jail is left out, as it is where a script's own time is taken away from the whole."""

import os
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from statistics import median

from matplotlib.figure import Figure

from grader.exercises import Plan, list_codes, plan_exercise
from grader.grading.pipeline import Pipeline
from grader.library import load
from grader.questions.kinds.script import ScriptQuestion
from grader.sandbox.jail import Jail
from grader.settings import Settings
from grader.store.engine.database import Database
from grader.store.upkeep.installation import hidden_case_secret
from grader.studies.bench.service.answers import list_backends, open_database
from grader.studies.bench.service.bare_script import open_bare_process
from grader.studies.bench.service.submitting import Client, require, serve_clients
from grader.studies.bench.service.workers import read_family_cpu_s
from grader.studies.bench.study import Measurement, Record, Records, Study
from grader.studies.bench.timing import TimeRatio, compute_median_interval

QUIZ = "1.3-exercises"

PROGRAMS: Mapping[str, Sequence[str]] = {
    "servo-threshold": ("whole_runs_in_one_call", "the_lessons_script_and_a_bisection"),
    "rk4-step": ("classical",),
    "rk4-free-joint": ("one_mj_integratepos", "quaternion_derivative"),
}
"""Right answers to the exercises of the shipped quizzes, by the names of their files after `correct__`."""

IMPORT = "import mujoco, numpy"
SETTLE_S = 0.2
"""After a verdict the service stores it and makes the next process of the jail; its CPU time is read so much later."""
NUMBERS = count()
"""Makes every script differ from all others, so that each draws its cases anew."""


@dataclass(frozen=True)
class Script(Measurement):
    """A right answer, handed in again and again, in turn with its bare function and with a cold import of MuJoCo."""

    exercise: str
    program: str
    backend: str

    def measure(self, quick: bool, done: Records) -> Record:
        """Medians by part [s], and their ratios to the bare function, with 95 % intervals.

        `whole` is the wall time from handing in to the verdict that is heard. The others are CPU times: `child` of the
        script's process in the jail, from its first byte on; `judge` of simulating and judging; `service` of all the
        rest, such as the server, the queue, the supervisor and the next process of the jail, as the mean of a script.
        `bare` is the CPU time of the function alone, `imported` the wall time of a new interpreter.
        """
        source, rounds = read_program(self.exercise, self.program), 3 if quick else 9
        rows: list[dict[str, float]] = []
        with ExitStack() as stack:
            url = stack.enter_context(open_database(self.backend))
            bare = stack.enter_context(open_bare_process())
            (client,) = stack.enter_context(serve_clients(1, GRADER_DATABASE_URL=url, GRADER_WORKERS="1"))
            pipeline = open_pipeline(url)
            kind = find_exercise(pipeline, self.exercise).check.kind
            used_s = 0.0
            for number in range(rounds + 1):
                answer = f"{source}# {next(NUMBERS)}\n"
                before_s = read_family_cpu_s(client.server)
                row = grade_script(client, self.exercise, answer)
                time.sleep(SETTLE_S)
                spent_s = read_family_cpu_s(client.server) - before_s
                plan = plan_again(pipeline, self.exercise, answer)
                row |= {"bare": bare.measure_cpu_s(kind, source, plan), "imported": measure_import_s()}
                if number:  # the first meets cold caches
                    used_s += spent_s
                    rows.append(row)
        seconds = {name: median(row[name] for row in rows) for name in rows[0]}
        seconds["service"] = used_s / rounds - median(row["child"] + row["judge"] for row in rows)
        ratios = {}
        for name in ("whole", "child", "judge"):
            pairs = [row[name] / row["bare"] for row in rows]
            ratios[name] = [median(pairs), *compute_median_interval(pairs)]
        ratios["service"] = [seconds["service"] / seconds["bare"]] * 3
        wait = median((row["whole"] - 1.5 * row["bare"]) / row["imported"] for row in rows)
        effort = {"scripts": rounds, "load_average": os.getloadavg()[0]}
        return {"seconds": seconds, "ratios": ratios, "wait_in_imports": wait, **effort}

    def rows(self, record: Record) -> list[Record]:
        """Returns one row: seconds and ratios by part."""
        seconds = {f"{name}_s": value for name, value in record["seconds"].items()}
        ratios = {f"{name}_ratio": values[0] for name, values in record["ratios"].items()}
        intervals = {f"{name}_ratio_interval": values[1:] for name, values in record["ratios"].items()}
        rest = {name: record[name] for name in ("wait_in_imports", "scripts", "load_average")}
        return [{**seconds, **ratios, **intervals, **rest}]


def read_program(exercise: str, program: str) -> str:
    """Returns the text of a reference solution."""
    folder = Settings().content / "reference_solutions" / QUIZ / exercise
    return (folder / f"correct__{program}.py").read_text(encoding="utf-8")


def open_pipeline(url: str) -> Pipeline:
    """Returns a pipeline that draws the cases of scripts as the server on this database does."""
    database = Database(url)
    try:
        return Pipeline(load(Path(Settings().content)), secret=hidden_case_secret(database))
    finally:
        database.close()


def find_exercise(pipeline: Pipeline, exercise: str) -> ScriptQuestion:
    """Returns an exercise of the quiz."""
    question = pipeline.library.question(QUIZ, exercise)
    assert isinstance(question, ScriptQuestion)
    return question


def plan_again(pipeline: Pipeline, exercise: str, source: str) -> Plan:
    """Returns the trials that the server has posed this script."""
    seed = pipeline.read(QUIZ, exercise, {"source": source}).seed
    assert seed is not None
    library = pipeline.library
    return plan_exercise(find_exercise(pipeline, exercise), library.model_xml, seed, library.text)


def grade_script(client: Client, exercise: str, source: str) -> dict[str, float]:
    """Hands a script in and waits for its verdict; the times of its parts [s]."""
    client.connection.close()  # and a new one: a server closes those that are idle
    began = time.perf_counter()
    verdict = client.graded(exercise, source)
    whole_s = time.perf_counter() - began
    require(verdict["status"] == "correct", verdict)
    timing = verdict["timing_ms"]
    return {"whole": whole_s, "child": timing["script_cpu"] / 1000, "judge": timing["judge_cpu"] / 1000}


def measure_import_s() -> float:
    """Wall time of a new interpreter that imports MuJoCo and NumPy [s]."""
    began = time.perf_counter()
    subprocess.run([sys.executable, "-c", IMPORT], check=True)  # noqa: S603  our own command
    return time.perf_counter() - began


def compare_with_bare(exercise: str, program: str, part: str, rounds: int = 8) -> TimeRatio:
    """The CPU time of the bare function over that of a `part` of grading, `child` or `judge`, without a server."""
    source, pairs = read_program(exercise, program), list[tuple[float, float]]()
    library = load(Path(Settings().content))
    with Jail(library.root / "models", 1, codes=list_codes()) as jail, open_bare_process() as bare:
        pipeline = Pipeline(library, jail.run)
        kind = find_exercise(pipeline, exercise).check.kind
        for _ in range(rounds):
            answer = f"{source}# {next(NUMBERS)}\n"
            verdict = pipeline.judge(pipeline.read(QUIZ, exercise, {"source": answer}))
            require(verdict.status == "correct", verdict)
            part_s = verdict.timing_ms[{"child": "script_cpu", "judge": "judge_cpu"}[part]] / 1000
            pairs.append((bare.measure_cpu_s(kind, source, plan_again(pipeline, exercise, answer)), part_s))
    (bare_s, part_s), ratios = map(min, zip(*pairs, strict=True)), tuple(ours / theirs for ours, theirs in pairs)
    return TimeRatio(median(ratios), compute_median_interval(ratios), bare_s, part_s, ratios)


def plan(_quick: bool) -> Sequence[Measurement]:
    """Every program on SQLite, and the quickest on every database: the others differ in the service alone."""
    programs = [(exercise, program) for exercise, names in PROGRAMS.items() for program in names]
    others = [Script(*programs[0], backend) for backend in list_backends() if backend != "sqlite"]
    return [Script(*programs[0], "sqlite"), *others, *(Script(*program, "sqlite") for program in programs[1:])]


def summarise(records: Records) -> Record:
    """Returns the records, as rows."""
    return {"scripts": [key.row() | row for key, record in records.items() for row in key.rows(record)]}


COLOURS = {"child": "#335599", "judge": "#ddaa33", "service": "#bb5566"}


def draw(records: Records, _summary: Record) -> Figure:
    """CPU time by part over that of the bare function; a line for the wall time until the verdict is heard."""
    figure = Figure(figsize=(7.5, 0.5 * len(records) + 1.5))
    axes = figure.subplots()
    for place, (key, record) in enumerate(records.items()):
        left = 0.0
        for name, colour in COLOURS.items():
            width = record["ratios"][name][0]
            axes.barh(place, width, left=left, color=colour, height=0.6, label=name if place == 0 else None)
            left += width
        axes.plot([record["ratios"]["whole"][0]] * 2, [place - 0.4, place + 0.4], color="black", linewidth=1.5)
        row = key.row()
        axes.text(0.03, place + 0.32, f"{row['exercise']}, {row['program']}, {row['backend']}", fontsize=7, va="bottom")
    axes.axvline(1, color="gray", linestyle="--", linewidth=1)
    axes.set_yticks([])
    axes.set_ylim(-0.6, len(records) - 0.2)
    axes.set_xlabel("CPU time over that of the bare function; black: wall time until the verdict is heard")
    axes.legend(loc="upper right", fontsize=8)
    return figure


STUDY = Study("script", plan, summarise, {"script": draw})
