"""Checks the expressions of a `verify`: they must compile, and what they name must be in the model."""

from collections.abc import Iterator

from grader.domain.verify import STABLE, ByExpression, ByMeasurement, ByOptions, ByOutcome, ByThreshold, Claim
from grader.errors import ContentError, Fault, NotFound
from grader.expressions import ProgramKind, compile_program
from grader.labs import list_missing_elements
from grader.library.json_text import join_key
from grader.questions import AnswerKey, ModelXml, OptionKey

Text = tuple[str, str, ProgramKind]
"""The key below `verify`, a text, and what it is."""


def list_verify_faults(key: AnswerKey, model_xml: ModelXml, question: str) -> Iterator[Fault]:
    """Yields a fault for each expression of a `verify` that does not compile, and for each element of a field that one
    names and its model does not have."""
    verify = key.verify
    programs = []
    for place, text, kind in list_texts(key):
        try:
            programs.append(
                compile_program(text, kind, join_key(question, *filter(None, (key.place, "verify", place))))
            )
        except ContentError as error:
            yield from error.faults
    lab = key.lab if isinstance(key, OptionKey) else None
    owner = lab if isinstance(verify, ByOptions | ByOutcome) else verify
    xml, model = getattr(owner, "xml", None), getattr(owner, "model", None)
    if xml is None and model is None:
        return
    try:
        yield from list_missing_elements(programs, xml or model_xml(str(model)))
    except (NotFound, ValueError):
        return


def list_texts(key: AnswerKey) -> Iterator[Text]:
    """Yields every expression of a `verify`."""
    verify = key.verify
    if isinstance(verify, ByExpression | ByMeasurement):
        yield "expr", verify.expr, "expression"
    if isinstance(verify, ByMeasurement):
        for place, text in (("setup", verify.setup), ("controller", verify.controller)):
            yield place, text or "", "statement"
    elif isinstance(verify, ByThreshold):
        for path in verify.set:
            yield f"set.{path}", f"{path} = value", "statement"
    elif isinstance(verify, ByOutcome):
        for index, claim in enumerate(verify.claims):
            yield _read_claim(f"claims.{index}", claim)
    elif isinstance(verify, ByOptions) and verify.criterion != STABLE:
        yield _read_claim("criterion", verify.criterion)


def _read_claim(place: str, claim: str | Claim) -> Text:
    """Returns the expression of a claim."""
    return (f"{place}.expr", claim.expr, "expression") if isinstance(claim, Claim) else (place, claim, "expression")
