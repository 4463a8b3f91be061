"""Certify answer keys: derive each again by simulation, or refuse it with the measurements."""

import time
from dataclasses import replace

from grader.certify.certificate import Certificate, refused
from grader.certify.experiments import VerifyError
from grader.certify.inference import infer
from grader.certify.numeric_keys import certify_expression, certify_measurement, certify_threshold
from grader.certify.predict_keys import certify_prediction
from grader.certify.stage_keys import certify_stage
from grader.domain.lab import LabConfig
from grader.domain.quiz import ChoiceQuestion, ModelXml, NumericQuestion, PredictQuestion, Question
from grader.domain.verify import ByExpression, ByMeasurement, ByOptions, ByOutcome, ByStage, ByThreshold, Verify
from grader.errors import CallerError, LabRefused

__all__ = ["Certificate", "certify_question"]

Decidable = ChoiceQuestion | PredictQuestion | NumericQuestion


def certify_question(question: Question, model_xml: ModelXml) -> Certificate | None:
    """Derive the key of a question again as its `verify` says, or as its text allows; None if physics cannot decide it.

    `model_xml` gives the MJCF of a named model. A `verify` that cannot be carried out becomes a refused certificate.
    """
    if not isinstance(question, ChoiceQuestion | PredictQuestion | NumericQuestion):
        return None
    began = time.perf_counter()
    try:
        verify = question.verify or infer(question)
        if verify is None:
            return None
        certificate = _certify(question, verify, model_xml)
    except (VerifyError, CallerError, LabRefused, ValueError) as error:
        key = error.key if isinstance(error, VerifyError) else "verify"
        certificate = refused("verify", question.answer, f"it cannot be re-derived: {error}", key=key)
    if question.verify is None and _all_stable(certificate):
        return None
    key = certificate.key if question.verify is not None else "answer"
    return replace(certificate, cost_ms=1000 * (time.perf_counter() - began), key=key)


def _certify(question: Decidable, verify: Verify, model_xml: ModelXml) -> Certificate:
    match question, verify:
        case NumericQuestion(), ByThreshold():
            return certify_threshold(question, verify, model_xml)
        case NumericQuestion(), ByMeasurement():
            return certify_measurement(question, verify, model_xml)
        case NumericQuestion(), ByExpression():
            return certify_expression(question, verify, model_xml)
        case ChoiceQuestion() | PredictQuestion(), ByStage():
            return certify_stage(question, verify, model_xml)
        case PredictQuestion(sim=LabConfig() as lab), ByOptions() | ByOutcome():
            return certify_prediction(question, lab, verify, model_xml)
    return refused(verify.by, question.answer, f"verify by {verify.by} does not fit a {question.kind} question")


def _all_stable(certificate: Certificate) -> bool:
    """Whether every option's run is stable; the question is then not about stability, and the inference is wrong."""
    runs = [m for name, m in certificate.measured.items() if name != "all integrators" and isinstance(m, dict)]
    return certificate.method == "options" and bool(runs) and all(run.get("stable", True) for run in runs)
