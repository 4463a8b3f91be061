"""Certifies the answer keys of whole quizzes: for a check of the content, and before it is served."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any

from grader.certify import Certificate, certify_key
from grader.certify.drawn import certify_corners
from grader.certify.remarks import Luck, estimate_luck, is_decidable
from grader.errors import Fault
from grader.exercises import TextOf
from grader.library import NOTHING_PASSED, Library, PassedChecks
from grader.library.checking.semantics import list_inputs
from grader.questions import AnswerKey, NumberKey, Question, grade_answer, kind_of
from grader.questions.drawing import is_drawn

if TYPE_CHECKING:
    from grader.certify.proposals import LabScene, Proposal

ACCEPT = "or write why the key holds as verify.accept"


@dataclass(frozen=True)
class CertifiedKey:
    """A key of a question of a quiz, and its certificate; None if physics cannot decide it."""

    quiz: str
    question: Question
    key: AnswerKey
    certificate: Certificate | None


def certify_quizzes(
    library: Library, quizzes: Iterable[str], passed: PassedChecks = NOTHING_PASSED,
    *, is_wanted: Callable[[str, str], bool] = lambda quiz, question: True,
) -> Iterator[CertifiedKey]:  # fmt: skip
    """Certifies every key of these quizzes, but for those whose certificates have been kept. `is_wanted` says of a quiz
    and a question whether to certify it, and is called before."""
    for quiz in quizzes:
        for question in library.quiz(quiz).questions:
            if not is_wanted(quiz, question.id):
                continue
            for key, certificate in certify_question(library, question, passed):
                yield CertifiedKey(quiz, question, key, certificate and name_slip(question, key, certificate))
            if is_drawn(question):
                yield from certify_drawn(library, quiz, question, passed)


def certify_question(
    library: Library, question: Question, passed: PassedChecks
) -> list[tuple[AnswerKey, Certificate | None]]:
    """Returns the keys of a question with their certificates: of several sets that are as right, the one that holds."""
    inputs, kind = list_inputs(question, library.models), kind_of(question)

    def certify_all(keys: Sequence[AnswerKey], which: int) -> list[tuple[AnswerKey, Certificate | None]]:
        return [
            (key, passed.run(
                "key", [*inputs, key.place, *([str(which)] if which else [])],
                lambda _, key=key: certify_key(key, library.model_xml),  # type: ignore[misc]
                text_of=library.text, write=write_certificate, read=read_certificate,
            ))
            for key in keys
        ]  # fmt: skip

    certified = certify_all(kind.answer_keys(question), 0)
    for which, keys in enumerate(kind.other_keys(question), start=1):
        if any(certificate is not None and not certificate.ok for _, certificate in certified):
            others = certify_all(keys, which)
            if all(certificate is None or certificate.ok for _, certificate in others):
                return others
    return certified


def name_slip(question: Question, key: AnswerKey, certificate: Certificate) -> Certificate:
    """Returns a certificate that also names the known slip behind a refuted number, such as another unit. The number is
    graded like an answer of a learner's whose key is the derived one."""
    is_number = isinstance(key, NumberKey) and not key.place and not is_drawn(question)
    if not is_number or certificate.verdict != "refuted" or certificate.answer is None:
        return certificate
    derived = question.model_copy(update={"answer": float(certificate.answer), "tol": None})
    slip = grade_answer(derived, certificate.expected).diagnosis
    if slip is None:
        return certificate
    seen, _, _ = slip.partition(":")  # the cure is a learner's
    return replace(certificate, why=f"{certificate.why}. {seen}: correct `answer` or `unit`")


def certify_drawn(library: Library, quiz: str, question: Question, passed: PassedChecks) -> Iterator[CertifiedKey]:
    """Yields the certificates of a question that fail or are remarked on at the ends of what is drawn."""
    keys = {key.place: key for key in kind_of(question).answer_keys(question)}
    told = passed.run(
        "corners",
        list_inputs(question, library.models),
        lambda _: list(certify_corners(question, library.model_xml)),
        text_of=library.text,
        write=lambda some: {key.place: asdict(certificate) for key, certificate in some} if is_all_held(some) else None,
        read=lambda stored: [
            (keys[place], certificate) for place, one in stored.items() if (certificate := read_certificate(one))
        ],
    )
    for key, certificate in told:
        yield CertifiedKey(quiz, question, key, certificate)


def is_all_held(certified: Iterable[tuple[AnswerKey, Certificate]]) -> bool:
    """Whether no certificate fails."""
    return all(certificate.ok for _, certificate in certified)


def propose_for_key(
    library: Library, quiz: str, question: Question, key: AnswerKey, passed: PassedChecks = NOTHING_PASSED
) -> "Proposal | None":
    """Returns a `verify` for a key that has none and that no simulation confirms, or None where the simulations near
    the question suggest none. What was proposed before for the same question and simulations is kept."""
    from grader.certify.proposals import Proposal, find_scenes, propose_verify  # a server that starts proposes nothing

    if not is_decidable(key) or is_drawn(question):  # whose `verify` has to name what is drawn, and is demanded
        return None
    scenes = find_scenes(library, quiz, question)

    def propose(_: TextOf) -> Proposal | None:
        text = question.q if not key.place else f"{question.q} {key.text}"
        return propose_verify(key, scenes, library.model_xml, text)

    return passed.run(
        "proposal",
        [*list_inputs(question, library.models), key.place, *list_scene_inputs(scenes)],
        propose,
        text_of=library.text,
        write=lambda proposal: {} if proposal is None else asdict(proposal),
        read=lambda stored: Proposal(**stored) if stored else None,
    )


def propose_for_question(
    library: Library, quiz: str, question: Question, passed: PassedChecks = NOTHING_PASSED
) -> "Iterator[Proposal]":
    """Yields the proposals for the keys of one question that no simulation confirms."""
    for certified in certify_quizzes(library, [quiz], passed, is_wanted=lambda _, other: other == question.id):
        if certified.certificate is None and (
            proposal := propose_for_key(library, quiz, question, certified.key, passed)
        ):
            yield proposal


def list_scene_inputs(scenes: "Iterable[LabScene]") -> Iterator[str]:
    """Yields all that proposals from these simulations depend on."""
    for scene in scenes:
        yield from (scene.lab.model_dump_json(), scene.xml)


def write_certificate(certificate: Certificate | None) -> dict[str, Any] | None:
    """Returns a certificate as JSON, which is empty where physics cannot decide; None if it refuses the key."""
    if certificate is None:
        return {}
    return asdict(certificate) if certificate.ok else None


def read_certificate(stored: dict[str, Any]) -> Certificate | None:
    """Returns the certificate of this JSON."""
    return None if not stored else Certificate(**stored | {"remarks": tuple(stored["remarks"])})


def bound_luck(library: Library, question: Question, passed: PassedChecks = NOTHING_PASSED) -> Luck:
    """Returns the chance of luck at an exercise, if need be by `estimate_luck`."""
    return passed.run(
        "luck",
        list_inputs(question, library.models),
        lambda text_of: estimate_luck(question, library.model_xml, text_of),
        text_of=library.text,
        write=lambda luck: asdict(luck) if luck.why is None else None,
        read=lambda stored: Luck(**stored),
    )


def find_refused_keys(
    library: Library, quizzes: Iterable[str], passed: PassedChecks = NOTHING_PASSED
) -> Iterator[Fault]:
    """Yields a fault for each key that simulation refutes, or cannot tell and the author has not accepted."""
    for certified in certify_quizzes(library, quizzes, passed):
        if certified.certificate is not None and not certified.certificate.is_publishable:
            yield build_fault(library, certified.quiz, certified.question, certified.certificate)


def build_fault(library: Library, quiz: str, question: Question, certificate: Certificate) -> Fault:
    """Returns the fault of a key that may not be published: file, field and why, with a cure."""
    cure = "" if certificate.verdict == "refuted" or certificate.method == "verify" else f"; {ACCEPT}"
    why = f"{certificate.verdict}: {certificate.why}{cure}"
    return Fault(library.file(quiz), f"{question.id}.{certificate.key}", why)
