"""Keys of questions with drawn numbers: derived for those of a learner, and certified at the ends of their ranges."""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, cast

from grader.certify import Certificate, certify_key
from grader.errors import GraderError
from grader.experiments.limits import UNCERTAINTY_SHARE
from grader.questions import AnswerKey, ModelXml, NumberKey, Question, kind_of
from grader.questions.drawing import PROSE, Drawable, draw_numbers, list_corners, list_names
from grader.questions.kinds.number import explain_wide

INSIDE = 8
"""Draws of which the sign of a key without a tolerance is looked at, beside the ends of the ranges."""


class NoKey(GraderError):
    """Nothing derives the key of some numbers."""


def settle(question: Question, numbers: Mapping[str, float], model_xml: ModelXml) -> Question:
    """Returns a question with these numbers, and the key that simulation derives for them. Raises NoKey, also where the
    key is not known to a share of its tolerance."""
    drawable = cast(Drawable, question)

    def pose(certificates: Mapping[str, Certificate]) -> Question:
        answers = {
            place: certificate.answer for place, certificate in certificates.items() if certificate.answer is not None
        }
        return cast(Question, drawable.with_numbers(numbers, answers))

    certificates: dict[str, Certificate] = {}
    posed = pose(certificates)
    for key in kind_of(posed).answer_keys(posed):
        certificates[key.place] = derive(key, numbers, model_xml)
    settled = pose(certificates)
    for key in kind_of(settled).answer_keys(settled):
        if not is_known(certificates[key.place], key):  # to the tolerance of the question as loaded, which may be wider
            certificates[key.place] = derive(key, numbers, model_xml, for_publication=True)
    return pose(certificates)


def derive(
    key: AnswerKey, numbers: Mapping[str, float], model_xml: ModelXml, *, for_publication: bool = False
) -> Certificate:
    """Returns the certificate with the answer of a key, one that holds to its tolerance `for_publication`. Raises
    NoKey."""
    certificate = certify_key(key, model_xml)
    if certificate is None or certificate.answer is None or (for_publication and not certificate.is_publishable):
        why = "no verify says how" if certificate is None else certificate.why
        raise NoKey(f"the key for {describe(numbers)} cannot be derived: {why}")
    return certificate


def is_known(certificate: Certificate, key: AnswerKey) -> bool:
    """Whether the uncertainty of a derived number is a small share of the tolerance of its key."""
    doubt = certificate.uncertainty
    return not isinstance(key, NumberKey) or doubt is None or doubt <= UNCERTAINTY_SHARE * key.tolerance


def certify_corners(question: Question, model_xml: ModelXml) -> Iterator[tuple[AnswerKey, Certificate]]:
    """Yields the certificates that fail for numbers at the ends of their ranges, with the key of the question, and one
    with a remark where a tolerance is too wide there. A key that is derived there must hold at other timesteps, too,
    and must come from every number."""
    keys = kind_of(question).answer_keys(question)
    for name in list_unused(cast(Drawable, question)):
        why = (
            f"{{{name}}} is in q, but nothing that derives the key uses it, so that every learner has the same key: "
            "write it into `verify`, even where it changes nothing"
        )
        yield keys[0], Certificate("cannot tell", why, "verify", None, keys[0].answer, key="draw")
    signs: dict[str, set[bool]] = {key.place: set() for key in keys}
    held: dict[str, list[tuple[str, Certificate]]] = {key.place: [] for key in keys}
    for numbers in list_corners(cast(Drawable, question).draw):
        try:
            posed = settle(question, numbers, model_xml)
        except NoKey as error:
            yield keys[0], Certificate("cannot tell", str(error), "verify", None, keys[0].answer, key="draw")
            continue
        for key, own in zip(keys, kind_of(posed).answer_keys(posed), strict=True):
            signs[key.place].add(own.answer > 0)
            certificate = certify_key(own, model_xml)
            if certificate is not None and not certificate.ok:
                yield key, replace(certificate, why=f"with {describe(numbers)}: {certificate.why}", key="draw")
            elif certificate is not None:
                held[key.place].append((describe(numbers), certificate))
    for key in keys:
        yield from remark_wide(key, held[key.place])
        if not isinstance(key, NumberKey) or has_tolerance(cast(Drawable, question), key):
            continue
        if len(signs[key.place]) > 1 or changes_sign(question, key, signs[key.place], model_xml):
            why = "the key has either sign, and without `tol` next to nothing is right where it is near 0: give tol"
            at = f"{key.place}.tol" if key.place else "tol"
            yield key, Certificate("cannot tell", why, "verify", None, key.answer, key=at)


def remark_wide(key: AnswerKey, held: Sequence[tuple[str, Certificate]]) -> Iterator[tuple[AnswerKey, Certificate]]:
    """Yields a key and its smallest certificate of those that hold at the ends of the ranges, with a remark where the
    tolerance is too wide for it. A key of either sign has no smallest one, and one is enough that the middle has."""
    if not isinstance(key, NumberKey) or explain_wide(key.answer, key.tolerance) is not None or not held:
        return
    at, smallest = min(held, key=lambda end: abs(end[1].expected))
    why = explain_wide(smallest.expected, smallest.tolerance or 0.0)
    if why is not None and len({certificate.expected > 0 for _, certificate in held}) == 1:
        remark = (
            f"With {at} the key is {smallest.expected:.4g}, and tol is {smallest.tolerance:g}: {why}, or leave it out "
            "for 2 % of each key."
        )
        yield key, smallest.with_remark(remark)


def changes_sign(question: Question, key: AnswerKey, signs: set[bool], model_xml: ModelXml) -> bool:
    """Whether a key that has these `signs` at the ends of the ranges has another for some numbers between them."""
    for seed in range(INSIDE):
        try:
            posed = settle(question, draw_numbers(cast(Drawable, question).draw, seed), model_xml)
        except NoKey:  # which the ends tell of
            continue
        drawn = next(own for own in kind_of(posed).answer_keys(posed) if own.place == key.place)
        if (drawn.answer > 0) not in signs:
            return True
    return False


def has_tolerance(question: Drawable, key: AnswerKey) -> bool:
    """Whether the author gives the tolerance of a number."""
    raw = json.loads(question.template)
    if key.place:
        _, index = key.place.split(".")
        raw = raw["fields"][int(index)]
    return raw.get("tol") is not None


def list_unused(question: Drawable) -> list[str]:
    """Returns the names of the numbers that no `verify` uses, nor the lab that one runs."""
    raw = json.loads(question.template)
    parts: list[Any] = [raw.get("verify"), *(field.get("verify") for field in raw.get("fields", ()))]
    if raw["kind"] == "predict":
        parts += [value for key, value in (raw.get("sim") or {}).items() if key not in PROSE]
    used = list_names(json.dumps(parts))
    return [name for name in question.draw if name not in used]


def describe(numbers: Mapping[str, float]) -> str:
    """Returns numbers as text, such as `kp = 500, kv = 5`."""
    return ", ".join(f"{name} = {value:g}" for name, value in numbers.items())
