"""QuestionKind: the one interface through which every room asks a kind of question."""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Generic, NamedTuple, TypeVar, get_args

from grader.domain.lab import LabConfig
from grader.domain.plugins import Remark
from grader.domain.rubric import Rubric
from grader.domain.verdict import Status, Verdict
from grader.errors import InvalidAnswer
from grader.questions.answer_keys import AnswerKey
from grader.questions.question import Question, Reveal

Q = TypeVar("Q", bound=Question)
A = TypeVar("A")

Fields = Mapping[str, Sequence[str]]
"""The values of each field of a page's form that belongs to the answer: `answer`, or `answer.` and a name."""

FIELD = "answer"
"""The name of the one field of most kinds, and what the names of several begin with."""

NOTHING_TYPED = "Write an answer first."

TEMPLATE = "question.html"
"""The file beside the kind's module with its Jinja macros, which CONTRIBUTING.md lists."""


class Option(NamedTuple):
    """What the statistics count: an answer or a part of one, in plain text, and whether it is right."""

    text: str
    is_right: bool


class CountedNumber(NamedTuple):
    """A number of an answer whose wrong values the statistics count. Values within `tolerance` are the same; None:
    within half a unit of the third figure. `text` says in plain text which number of several it is."""

    unit: str = ""
    tolerance: float | None = None
    text: str = ""


@dataclass(frozen=True)
class Example:
    """A question as its author writes it, with answers and the status that each must get. The first answer is the best
    one. There are three or more, one of them INVALID_ANSWER and, unless a person grades the first, one INCORRECT. No
    hidden text of the question may stand in a shown one: the tests look for it on the pages. `files` are the other
    files of the content folder that the question needs, by path: models and starters."""

    question: Mapping[str, Any]
    answers: Sequence[tuple[Any, Status]]
    files: Mapping[str, str] = field(default_factory=dict)


def typed_in(fields: Fields, otherwise: str = NOTHING_TYPED) -> str:
    """Returns what was typed into the field `answer`. Raises InvalidAnswer with a sentence where that is nothing."""
    typed = next(iter(fields.get(FIELD, ())), "")
    if not typed.strip():
        raise InvalidAnswer(otherwise)
    return typed


class QuestionKind(ABC, Generic[Q, A]):
    """A kind of question, found through the entry-point group `grader.question_kinds`. `Q` is the model of the author's
    keys, `A` an answer once it is read. An answer is any JSON value. A kind must define `question`, `heading`, `read`,
    `describe`, `grade` and `example`, and the template question.html beside its module; the rest has defaults. No
    method may change anything or keep state: one object serves all threads."""

    question: type[Q]
    """The author's keys. `kind` must be a Literal of the names that choose this kind."""

    is_script: bool = False
    """Whether answers are scripts, which `grader.exercises` runs and judges in place of `grade`."""

    is_prose: bool = False
    """Whether the answer is a text that a person reads: reviewers see its words counted, and no verdict before
    theirs."""

    fences: Sequence[str] = ()
    """The words, beside `quiz`, that a fenced block of a lesson in Markdown with such a question may begin with."""

    @property
    def names(self) -> tuple[str, ...]:
        """The values of `kind` in authors' JSON that choose this kind."""
        return get_args(self.question.model_fields["kind"].annotation)

    @abstractmethod
    def example(self) -> Example:
        """Returns a question with answers: the tests walk them through every page and route."""

    # The author's part.

    def faults(self, question: Q) -> Iterator[Remark]:
        """Yields what is wrong with a question beyond its model; content with a fault is refused."""
        yield from ()

    def warnings(self, question: Q) -> Iterator[Remark]:
        """Yields what may surprise the author; it does not prevent serving."""
        yield from ()

    def import_block(self, raw: Mapping[str, Any]) -> Mapping[str, Any] | str:
        """Returns the question in a fenced block that begins with one of `fences`, or why it is left in the lesson."""
        return raw

    def answer_keys(self, question: Q) -> Sequence[AnswerKey]:
        """Returns the parts of the key that a simulation may derive again; none where no `verify` is allowed."""
        return ()

    def other_keys(self, question: Q) -> Sequence[Sequence[AnswerKey]]:
        """Returns other keys of the same parts that are as right, all together, as of a quaternion the negative one."""
        return ()

    def reveal(self, question: Q) -> Reveal | None:
        """Returns what the author lets the feedback on a wrong answer give away; None: the default."""
        return None

    def rubric(self, question: Q) -> Rubric:
        """Returns the items that a reviewer may tick."""
        return ()

    def reference(self, question: Q) -> str | None:
        """Returns the model answer that reviewers see, as HTML."""
        return None

    def sample_answers(self, question: Q) -> Sequence[Any]:
        """Returns answers that show an author how they are read and judged: the right one, wrong ones, and what people
        might type. None where only a person, or a run, could tell."""
        return ()

    # What a learner sees.

    @abstractmethod
    def heading(self, question: Q) -> str:
        """Returns what a page calls a question without a title."""

    def view(self, question: Q) -> dict[str, Any]:
        """Returns, as plain JSON, what a student may see beside id, kind, label, title, q, points and attempts. It is
        all that the template and the API have. Name each key: nothing of the answer, the tolerance, the explanation or
        a text for reviewers may be in it."""
        return {}

    def lab(self, question: Q) -> LabConfig | None:
        """Returns the simulation that a learner may run once the answer is given."""
        return None

    def starter(self, question: Q) -> str | None:
        """Returns the path, in the content folder, of the text that a learner begins with."""
        return None

    # A learner's answer.

    def from_form(self, question: Q, fields: Fields) -> Any:
        """Returns the answer, as the API takes it, of a form that was sent without JavaScript. `fields` may have any
        names and values, or none. Raises InvalidAnswer with a sentence for what is missing; what can be left to `read`
        should be."""
        return typed_in(fields)

    def to_form(self, question: Q, answer: Any) -> Fields:
        """Returns the fields that show an answer again: `from_form` must read them as the same answer. `answer` may be
        any JSON value, since the question may have changed; must not raise."""
        return {FIELD: [self.show(question, answer)]}

    def from_text(self, question: Q, text: str) -> Any:
        """Returns the answer that a person typed on a command line. Raises InvalidAnswer."""
        return text

    def show(self, question: Q, answer: Any) -> str:
        """Returns an answer as plain text, for a learner's story and for reviewers. `answer` may be any JSON value,
        since the question may have changed; must not raise."""
        return "" if answer is None else str(answer)

    @abstractmethod
    def read(self, question: Q, answer: Any) -> A:
        """Reads any JSON value. Raises InvalidAnswer with one sentence: why not, and what would be readable."""

    def carry_over(self, earlier: Q, question: Q, answer: Any) -> Any:
        """Returns an answer to an `earlier` version of a question as one to `question`, where what was chosen may stand
        elsewhere. Raises InvalidAnswer where it is none."""
        return answer

    @abstractmethod
    def describe(self, question: Q, answer: A) -> str:
        """Returns the answer as it was understood, for the learner to confirm; says nothing of right or wrong."""

    @abstractmethod
    def grade(self, question: Q, answer: A) -> Verdict:
        """Judges an answer: one finding or several, whose points add up to those of the question.

        Only `expected` of a finding may hold what was right, and evidence under names of your own, such as `regions`:
        both are shown with the solution. `message`, plain text like all texts of a finding, must not, and `direction`
        must not tell by how much an answer is off. Evidence `option` or `value` is what statistics count:
        an index of `options`, or a list of them; a number, or a list with one for each of `numbers`, None where that
        is right. `read_as` and `explain` are added by the caller.
        """

    # Statistics of all answers.

    def options(self, question: Q) -> Sequence[Option]:
        """Returns the answers that are counted, or their parts, by the indices of the evidence `option`."""
        return ()

    def numbers(self, question: Q) -> Sequence[CountedNumber]:
        """Returns the numbers of the evidence `value`."""
        return ()
