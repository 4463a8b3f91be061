"""Answer keys certified by physics: re-derived by the simulation that students see, or refused with the evidence."""

import time
from collections.abc import Callable
from dataclasses import replace

from grader.certify.certificate import Certificate, refused
from grader.certify.choices import certify_options, certify_outcome
from grader.certify.inference import infer
from grader.certify.numbers import certify_expression, certify_measurement, certify_threshold
from grader.certify.stages import certify_stage
from grader.domain.quiz import ChoiceQuestion, NumericQuestion, PredictQuestion, Question
from grader.domain.verify import (
    ByExpression,
    ByMeasurement,
    ByOptions,
    ByOutcome,
    ByStage,
    ByThreshold,
    Verify,
)
from grader.errors import CallerError, ContentError, LabError

__all__ = ["Certificate", "certify_question"]

ModelXml = Callable[[str], str]
Decidable = ChoiceQuestion | PredictQuestion | NumericQuestion


def certify_question(question: Question, model_xml: ModelXml) -> Certificate | None:
    """Re-derive the key of a question as its `verify` says, or as can be inferred; None where nothing decides it.

    `model_xml` gives the MJCF of a named model. Never raises for what an author may have written.
    """
    if not isinstance(question, ChoiceQuestion | PredictQuestion | NumericQuestion):
        return None
    began = time.perf_counter()
    verify = question.verify
    try:
        verify = verify or infer(question)
        certificate = None if verify is None else _certify(question, verify, model_xml)
    except (CallerError, ContentError, LabError, ValueError, KeyError) as error:
        key, why = _told(error, verify)
        certificate = refused("verify", question.answer, f"it cannot be re-derived: {why}", key=key)
    if certificate is None or (question.verify is None and _says_nothing(certificate)):
        return None
    key = certificate.key if question.verify is not None else "answer"
    return replace(certificate, cost_ms=1000 * (time.perf_counter() - began), key=key)


READ = {"options": "verify.criterion", "outcome": "verify.claims", "measurement": "verify.expr"}
"""What a certificate reads in a run, by the way of verifying; for the lab it is a readout."""


def _told(error: Exception, verify: Verify | None) -> tuple[str, str]:
    """The key of the question at which an error stands, and the error in words."""
    if isinstance(error, ContentError):
        place, why = error.faults[0].key, error.faults[0].why
    elif isinstance(error, LabError):
        place, _, why = str(error).partition(": ")
    elif isinstance(error, KeyError):
        why = str(error.args[0])
        place = "verify.key" if why.startswith("no key") else "verify"
    else:
        place, why = "verify", str(error)
    if "readouts" in place:
        place = READ.get(verify.by, "verify") if verify is not None else "verify"
    elif isinstance(verify, ByMeasurement):
        place = place.replace("lab.", "verify.", 1)
    return place if place.startswith("verify") else "verify", why


def _certify(question: Decidable, verify: Verify, model_xml: ModelXml) -> Certificate:
    if isinstance(question, NumericQuestion) and isinstance(verify, ByThreshold | ByMeasurement | ByExpression):
        return _certify_number(question, verify, model_xml)
    if isinstance(question, ChoiceQuestion | PredictQuestion) and isinstance(verify, ByStage):
        return certify_stage(question, verify, model_xml)
    if isinstance(question, PredictQuestion) and question.sim and isinstance(verify, ByOptions | ByOutcome):
        xml = question.sim.xml or model_xml(question.sim.model or "")
        if isinstance(verify, ByOptions):
            return certify_options(question, verify, xml)
        return certify_outcome(question, verify, xml)
    return refused(verify.by, question.answer, f"verify by {verify.by} does not fit a {question.kind} question")


def _certify_number(
    question: NumericQuestion, verify: ByThreshold | ByMeasurement | ByExpression, model_xml: ModelXml
) -> Certificate:
    if isinstance(verify, ByThreshold):
        return certify_threshold(question, verify, model_xml)
    if isinstance(verify, ByMeasurement):
        return certify_measurement(question, verify, model_xml)
    return certify_expression(question, verify, model_xml)


def _says_nothing(certificate: Certificate) -> bool:
    """An inferred criterion that tells no option from another: all runs are stable, so that was not the question."""
    runs = [m for name, m in certificate.measured.items() if name != "all integrators" and isinstance(m, dict)]
    return certificate.method == "options" and bool(runs) and all(run.get("stable", True) for run in runs)
