"""Reference programs of a content folder: the files, what their names and first lines demand, and what each gets."""

import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from itertools import takewhile
from pathlib import Path, PurePath

from grader.domain.run import SOURCE_BYTES_MAX
from grader.domain.verdict import Status
from grader.errors import CallerError, Fault, InvalidAnswer, NotFound
from grader.grading.pipeline import Pipeline
from grader.library.files import list_files, read_bytes, read_text
from grader.numerics.version import INSTALLED, parse_version
from grader.questions import FORMS, decode_file

FROM_VERSION = re.compile(r"# from MuJoCo (\d+\.\d+\.\d+): (\w+)(?:: (.+))?")
"""A line of a reference program: the version of MuJoCo from which on it gets another status, and its diagnosis."""

TAKES = {suffix: takes for takes, form in FORMS.items() for suffix in form.suffixes}
"""What a reference program is, by how its file ends."""

XML_COMMENT = partial(re.compile(r"^<!--(.*?)\s*-->\s*$").sub, r"#\1")
"""Returns a line of MJCF that is a comment as one of Python."""


NO_QUESTION = "not found"
"""What a program gets whose question is gone."""


@dataclass(frozen=True)
class ReferenceProgram:
    """A file reference_solutions/<quiz>/<question>/<status>__<why>.py, or another that exercises take; `file` is
    relative to the root. `source` is its text, or its base64. `status` and `diagnosis` are what it must get with the
    installed MuJoCo."""

    file: str
    source: str
    quiz: str
    question: str
    status: str
    diagnosis: str | None

    @property
    def answer(self) -> dict[str, str]:
        """The program as it is handed in."""
        return {FORMS[TAKES[Path(self.file).suffix]].key: self.source}


def find_references(root: Path) -> Iterator[ReferenceProgram | Fault]:
    """Yield every reference program, or the fault of its file."""
    for file in list_files(root, "reference_solutions", "*/*/*.*"):
        if (takes := TAKES.get(Path(file).suffix)) is None:
            continue
        source = head = read_text(root, file, SOURCE_BYTES_MAX) if not FORMS[takes].is_file else ""
        if FORMS[takes].is_file:
            data, beside = read_bytes(root, file, SOURCE_BYTES_MAX), Path(file).with_suffix(".txt").as_posix()
            source = data if isinstance(data, Fault) else decode_file(takes, data)
            head = read_text(root, beside, SOURCE_BYTES_MAX) if (root / beside).exists() else ""
        if isinstance(source, Fault):
            yield source
        elif isinstance(head, Fault):
            yield head
        else:
            _, quiz, question, name = Path(file).parts
            status, diagnosis = read_demand(head, Path(name).stem.partition("__")[0])
            yield ReferenceProgram(file, source, quiz, question, status, diagnosis)


def read_demand(source: str, status: str, installed: str = INSTALLED) -> tuple[str, str | None]:
    """Return the status and the diagnosis that a program must get, `status` being the one in its name. A first line `#
    diagnosis: ...` requires that diagnosis. A line `# from MuJoCo 4.0.0: incorrect: ...` below it says what the program
    gets with this version or a later one; of several lines the last that applies counts. MJCF has `<!--` in place of
    `#`."""
    head = list(takewhile(lambda line: line.startswith("#"), map(XML_COMMENT, source.splitlines())))
    diagnosis = head[0].removeprefix("# diagnosis:").strip() if head and head[0].startswith("# diagnosis:") else None
    for match in filter(None, map(FROM_VERSION.fullmatch, head)):
        if parse_version(installed) >= parse_version(match[1]):
            status, diagnosis = match[2], match[3]
    return status, diagnosis


@dataclass(frozen=True)
class ReferenceOutcome:
    """What a reference program got under one seed."""

    got: str
    diagnosis: str | None
    faults: str = ""
    """What is wrong with the pictures that the kind built."""

    def __str__(self) -> str:
        return f"{self.got} ({self.diagnosis})" if self.diagnosis else self.got


def grade_one(pipeline: Pipeline, reference: ReferenceProgram, seed: int) -> ReferenceOutcome:
    """Grade a reference program under one seed."""
    try:
        verdict = pipeline.grade(reference.quiz, reference.question, reference.answer, seed)
    except (CallerError, InvalidAnswer) as error:
        return ReferenceOutcome(NO_QUESTION if isinstance(error, NotFound) else "no verdict", str(error))
    faults = "; ".join(verdict.evidence.get("faults", ()))
    return ReferenceOutcome(verdict.status.value, verdict.diagnosis, faults)


def list_mismatches(reference: ReferenceProgram, outcomes: dict[int, ReferenceOutcome]) -> Iterator[str]:
    """Yield each difference between the outcomes, by seed, and what the reference program requires."""
    if reference.status not in set(Status):
        yield f"the name must begin with a status: {', '.join(Status)}"
        return
    counts = Counter(outcomes.values())
    for outcome, count in counts.items():
        seed = next(seed for seed, other in outcomes.items() if other == outcome)
        where = f" in {count} of {len(outcomes)} draws, as with --seed {seed}" if len(outcomes) > 1 else ""
        if outcome.got != reference.status:
            name = f"{outcome.got}__{PurePath(reference.file).name.partition('__')[2]}"
            cure = ""
            if outcome.got == Status.GRADER_FAULT:
                cure = "; mend the kind: the log on stderr has the traceback"
            elif outcome.got in set(Status) and len(counts) == 1:
                cure = f"; mend it or the exercise, or name the file {name}"
            elif outcome.got == NO_QUESTION:
                cure = f"; rename the folder {PurePath(reference.file).parent} after it, or remove it"
            yield f"graded {outcome}{where}{cure}"
        elif reference.diagnosis and reference.diagnosis not in (outcome.diagnosis or ""):
            yield f"diagnosis is {outcome.diagnosis!r}, not {reference.diagnosis!r}{where}"
        elif outcome.faults:
            yield f"the kind builds pictures that no page can draw{where}: {outcome.faults}; mend its build_pictures"
        elif len(counts) > 1:
            yield f"the verdict depends on the draw: {outcome}{where}"
