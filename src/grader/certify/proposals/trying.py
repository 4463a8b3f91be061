"""Certifies a key under a `verify` that is tried."""

from dataclasses import replace

from mujoco import FatalError

from grader.certify import Certificate, certify_key
from grader.domain.verify import Verify
from grader.errors import GraderError
from grader.experiments.regime import RegimeFailure
from grader.questions import AnswerKey, ModelXml

BROKEN = (GraderError, ValueError, KeyError, FatalError, RegimeFailure)
"""What a simulation that cannot be run raises: it gives no candidates."""


def certify_with(key: AnswerKey, verify: Verify, model_xml: ModelXml) -> Certificate | None:
    """Returns the certificate of a key as if it had this `verify`; None where that cannot be carried out."""
    try:
        return certify_key(replace(key, verify=verify), model_xml)
    except BROKEN:
        return None
