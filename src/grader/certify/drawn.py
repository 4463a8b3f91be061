"""Keys of questions with drawn numbers: derived for those of a learner, and certified at the ends of their ranges."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import cast

from grader.certify import Certificate, certify_key
from grader.errors import GraderError
from grader.questions import AnswerKey, ModelXml, Question, kind_of
from grader.questions.drawing import Drawable, list_corners


class NoKey(GraderError):
    """Nothing derives the key of some numbers."""


def settle(question: Question, numbers: Mapping[str, float], model_xml: ModelXml) -> Question:
    """Returns a question with these numbers, and the key that simulation derives for them. Raises NoKey."""
    drawable = cast(Drawable, question)
    posed = cast(Question, drawable.with_numbers(numbers))
    answers: dict[str, float] = {}
    for key in kind_of(posed).answer_keys(posed):
        certificate = certify_key(key, model_xml)
        if certificate is None or certificate.answer is None:
            why = "no verify says how" if certificate is None else certificate.why
            raise NoKey(f"the key for {describe(numbers)} cannot be derived: {why}")
        answers[key.place] = certificate.answer
    return cast(Question, drawable.with_numbers(numbers, answers))


def certify_corners(question: Question, model_xml: ModelXml) -> Iterator[tuple[AnswerKey, Certificate]]:
    """Yields the certificates that fail for numbers at the ends of their ranges, with the key of the question. A key
    that is derived there must hold at other timesteps, too."""
    keys = kind_of(question).answer_keys(question)
    for numbers in list_corners(cast(Drawable, question).draw):
        try:
            posed = settle(question, numbers, model_xml)
        except NoKey as error:
            yield keys[0], Certificate("cannot tell", str(error), "verify", None, keys[0].answer, key="draw")
            continue
        for key, own in zip(keys, kind_of(posed).answer_keys(posed), strict=True):
            certificate = certify_key(own, model_xml)
            if certificate is not None and not certificate.ok:
                yield key, replace(certificate, why=f"with {describe(numbers)}: {certificate.why}", key="draw")


def describe(numbers: Mapping[str, float]) -> str:
    """Returns numbers as text, such as `kp = 500, kv = 5`."""
    return ", ".join(f"{name} = {value:g}" for name, value in numbers.items())
