"""Proposes a `verify` for a key that has none: quantities of the question's own simulation are measured, and compared
with the key. A proposal is for the author to read and paste: it certifies nothing and refuses nothing.
"""

from collections.abc import Sequence

from grader.certify.proposals.number_proposals import propose_for_number
from grader.certify.proposals.option_proposals import propose_for_option
from grader.certify.proposals.proposal import Proposal
from grader.certify.proposals.scenes import LabScene, find_scenes
from grader.questions import AnswerKey, ModelXml, NumberKey

__all__ = ["LabScene", "Proposal", "find_scenes", "propose_verify"]


def propose_verify(key: AnswerKey, scenes: Sequence[LabScene], model_xml: ModelXml, text: str) -> Proposal | None:
    """Returns a proposal for a key without a `verify`, or None where its simulations suggest none. `text` is all that
    the question says. Costs a run of each of the `scenes`, and the certification of a few candidates."""
    if isinstance(key, NumberKey):
        return propose_for_number(key, scenes, model_xml, text)
    return propose_for_option(key, scenes, model_xml, text)
