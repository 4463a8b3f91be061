"""A corpus of wrong programs, written apart from the code that recognises mistakes: most are told their own."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from grader.grading.pipeline import Pipeline
from grader.numerics.version import RK4_ORDER_ON_ROTATIONS
from grader.sandbox.jail import Jail
from support.content import load_content

pytestmark = [pytest.mark.jail, pytest.mark.slow]

ROOT = Path(__file__).parents[2]
CORPUS = Path(__file__).parent / "corpus"
SEED = 1

GENERIC = {
    *("rk4-free-joint/four_velocities_for_a_ball", "servo-threshold/count_read_before_the_run"),
    *("servo-threshold/textbook_explicit_euler", "rk4-free-joint/rates_in_the_order_of_yaw"),
}
"""Programs that get a sentence which is true and does not name their mistake, as a reader of both judged."""


def status_of(program: Path) -> str:
    return header(program)["status"]


def named(program: Path) -> str:
    return f"{program.parent.name}/{program.stem}"


def header(program: Path) -> dict[str, str]:
    lines = program.read_text(encoding="utf-8").splitlines()
    parts = (
        line[2:].partition(": ") for line in lines if line.startswith(("# mistake", "# next", "# status", "# told"))
    )
    return {key: value for key, _, value in parts}


def expected_of(program: Path) -> tuple[str, str]:
    """Status and sentence with the installed MuJoCo."""
    lines = header(program)
    if "told from MuJoCo 4.0.0" in lines and RK4_ORDER_ON_ROTATIONS == 4:
        status, _, told = lines["told from MuJoCo 4.0.0"].partition(": ")
        return status, told
    return lines["status"], lines["told"]


def source_of(program: Path) -> str:
    """The program without its header: `told` was added after the lines were counted."""
    lines = program.read_text(encoding="utf-8").splitlines()
    kept = (line for line in lines if not line.startswith("# told"))
    return "".join("#\n" if line.startswith(("# mistake", "# next", "# status")) else f"{line}\n" for line in kept)


PROGRAMS = [program for program in sorted(CORPUS.glob("*/*.py")) if status_of(program) != "timed_out"]
"""Without the three that use up their 20 s; tests/sandbox has time-outs of its own."""


@pytest.fixture(scope="module")
def pipeline() -> Iterator[Pipeline]:
    library = load_content("1.3-exercises")
    with Jail(library.root / "models", allow_t2=True) as jail:
        yield Pipeline(library, jail.run)


@pytest.mark.parametrize("program", PROGRAMS, ids=named)
def test_a_program_gets_its_status_and_its_sentence(program: Path, pipeline: Pipeline) -> None:
    status, told = expected_of(program)
    verdict = pipeline.grade("1.3-exercises", program.parent.name, {"source": source_of(program)}, SEED)
    assert verdict.status.value == status
    assert told in (verdict.diagnosis or "")


def test_nine_of_ten_are_told_their_own_mistake() -> None:
    assert {named(program) for program in PROGRAMS} >= GENERIC
    assert len(PROGRAMS) >= 190
    assert len(GENERIC) <= len(PROGRAMS) / 10
