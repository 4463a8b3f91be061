"""Certifies answer keys.

It derives each key again by simulation, or refuses it with the measurements.
"""

import time
from dataclasses import replace
from functools import partial

from mujoco import FatalError, MjModel

from grader.certify.certificate import Certificate, refuse
from grader.certify.contradictions import WORDED, list_contradictions
from grader.certify.inference import asks_for_stability, infer_verify
from grader.certify.measurement_keys import EMPTY, certify_expression, certify_measurement
from grader.certify.predict_keys import certify_prediction
from grader.certify.stage_keys import certify_stage
from grader.certify.threshold_keys import certify_threshold
from grader.domain.lab import LabConfig
from grader.domain.quantities import BASE_UNITS
from grader.domain.verify import (
    ByExpression,
    ByHand,
    ByMeasurement,
    ByOptions,
    ByOutcome,
    ByStage,
    ByThreshold,
    Verify,
)
from grader.errors import CallerError, LabRefused
from grader.experiments.runs import VerifyError, read_xml
from grader.questions import AnswerKey, ModelXml, NumberKey, OptionKey
from grader.questions.kinds.number.dimensions import explain_missing_unit, explain_unit

__all__ = ["Certificate", "certify_key"]

INFERRED = (
    "what to derive was read from the words of the question: correct `answer`, or write what it asks for as a "
    '`verify`, or why the key holds as "verify": {"by": "hand", "accept": "..."}'
)
"""The end of a fault of a key without `verify`."""

LINEARISING = "mjd_"
"""How MuJoCo's functions begin that linearise a motion; they know neither delays nor sleeping bodies."""

GIVEN = ': write "timestep": "given" if the number is about the run at the own timestep'


def certify_key(key: AnswerKey, model_xml: ModelXml) -> Certificate | None:
    """Derive a key again as its `verify` says, or as the text of its question allows; None if physics cannot decide it.

    `model_xml` gives the MJCF of a named model. A `verify` that cannot be carried out becomes a refused certificate.
    """
    began = time.perf_counter()
    try:
        verify = key.verify or infer_verify(key)
        if verify is None:
            return None
        certificate = _derive(key, verify, model_xml)
    except (VerifyError, CallerError, LabRefused, ValueError, FatalError) as error:
        at = error.key if isinstance(error, VerifyError) else "verify"
        certificate = refuse("verify", key.answer, f"it cannot be re-derived: {error}", key=at)
    if key.verify is None and (_are_all_stable(certificate) or _is_about_something_else(certificate, key)):
        return None
    if key.verify is None and not certificate.ok:
        certificate = replace(certificate, why=f"{certificate.why}; {INFERRED}")
    certificate = _remark_words(_remark_other_model(certificate, key), key, model_xml)
    at = certificate.key if key.verify is not None else "answer"
    at = f"{key.place}.{at}" if key.place else at
    return replace(certificate, cost_ms=1000 * (time.perf_counter() - began), key=at)


def _derive(key: AnswerKey, verify: Verify, model_xml: ModelXml) -> Certificate:
    """Returns the certificate of a key whose `verify` can be carried out, as the author accepts it."""
    if isinstance(verify, ByHand):
        certificate = refuse("hand", key.answer, "nothing was simulated, since the key is derived by hand")
    else:
        try:
            certificate = _compare_units(_certify(key, verify, model_xml), key, model_xml)
        except FatalError as error:
            if LINEARISING not in str(error):
                raise
            given = GIVEN if isinstance(verify, ByMeasurement) else ""
            why = (
                f"the motion cannot be linearised, so nothing tells whether a timestep is short enough for it ({error})"
            )
            certificate = refuse(verify.by, key.answer, f"{why}{given}", failed="linearised")
    return certificate if verify.accept is None else _accept(certificate, verify.accept)


def _accept(certificate: Certificate, reason: str) -> Certificate:
    """Accept a key that simulation cannot tell, for the author's reason; a remark where it can be told."""
    if certificate.ok:
        remark = "Simulation certifies this key: verify.accept is no longer needed."
        return certificate.with_remark(remark)
    return replace(certificate, accepted=reason) if certificate.verdict == "cannot tell" else certificate


def _compare_units(certificate: Certificate, key: AnswerKey, model_xml: ModelXml) -> Certificate:
    """Cannot tell of a number whose expression is in another unit than its question: 0.5 rad are not 0.5 degrees, and
    neither certify nor refute them."""
    verify = key.verify
    is_decided = certificate.verdict != "cannot tell"
    if not (is_decided and isinstance(key, NumberKey) and isinstance(verify, ByMeasurement | ByExpression)):
        return certificate
    if isinstance(verify, ByMeasurement) and verify.when in BASE_UNITS:  # of moments, whatever the expression is in
        return certificate
    model = _read_model(verify, model_xml)
    if not key.unit:
        remark = explain_missing_unit(verify.expr, model) if certificate.ok else None
        return certificate if remark is None else certificate.with_remark(remark)
    why = explain_unit(verify.expr, model, key.unit)
    return certificate if why is None else replace(certificate, verdict="cannot tell", why=why, key="unit")


def _read_model(verify: ByMeasurement | ByExpression | ByThreshold | ByStage, model_xml: ModelXml) -> MjModel:
    """Returns the model that a `verify` names, or an empty one."""
    named = verify.model or verify.xml
    return MjModel.from_xml_string(read_xml(verify.model, verify.xml, model_xml) if named else EMPTY)


def _remark_words(certificate: Certificate, key: AnswerKey, model_xml: ModelXml) -> Certificate:
    """Remark where the words of a question say otherwise than the `verify` that certifies its key."""
    if certificate.ok and isinstance(key.verify, WORDED):
        for remark in list_contradictions(key.text, key.verify, partial(_read_model, key.verify, model_xml)):
            certificate = certificate.with_remark(remark)
    return certificate


def _remark_other_model(certificate: Certificate, key: AnswerKey) -> Certificate:
    """Remark where the simulation that learners see after their answer is of another model than the one measured."""
    if not (isinstance(key, NumberKey) and isinstance(key.verify, ByMeasurement) and key.lab is not None):
        return certificate
    measured, shown = key.verify.model, key.lab.model
    if measured is None or shown is None or measured == shown:
        return certificate
    remark = f"The key is measured of the model {measured}, and the simulation of the question shows {shown}."
    return certificate.with_remark(remark)


def _certify(key: AnswerKey, verify: Verify, model_xml: ModelXml) -> Certificate:
    match key, verify:
        case NumberKey(), ByThreshold():
            return certify_threshold(key, verify, model_xml)
        case NumberKey(), ByMeasurement():
            return certify_measurement(key, verify, model_xml)
        case NumberKey(), ByExpression():
            return certify_expression(key, verify, model_xml)
        case OptionKey(), ByStage():
            return certify_stage(key, verify, model_xml)
        case OptionKey(lab=LabConfig() as lab), ByOptions() | ByOutcome():
            return certify_prediction(key, lab, verify, model_xml)
    cure = ": make it a predict question, whose sim it runs" if isinstance(verify, ByOptions | ByOutcome) else ""
    return refuse(verify.by, key.answer, f"verify by {verify.by} does not fit a {key.kind} question{cure}")


def _is_about_something_else(certificate: Certificate, key: AnswerKey) -> bool:
    """Whether stability, which was inferred, refutes the key of a question that does not ask for it, as one that asks
    which setting is unstable."""
    return certificate.method == "options" and not certificate.ok and not asks_for_stability(key)


def _are_all_stable(certificate: Certificate) -> bool:
    """Whether every option's run is stable; the question is then not about stability, and the inference is wrong."""
    runs = [m for name, m in certificate.measured.items() if name != "all integrators" and isinstance(m, dict)]
    return certificate.method == "options" and bool(runs) and all(run.get("stable", True) for run in runs)
