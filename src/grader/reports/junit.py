"""JUnit XML, as GitLab and the readers of GitHub Actions take it. There is no one standard. The elements and attributes
used here are those of Jenkins' junit-10.xsd, which gives the number of skipped tests to a suite alone; GitLab reads
`classname`, `name`, `time` and the text of `failure`, `error` and `skipped`, never their attributes."""

import re
from xml.etree import ElementTree

from grader.domain.verdict import Status
from grader.reports.graded import GradedAnswer

ILLEGAL = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""Characters that XML 1.0 cannot hold. Source: W3C, XML 1.0, section 2.2."""

KINDS = ("failure", "error", "skipped")
UNDECIDED = "A person decides on this."


def junit_xml(graded: GradedAnswer) -> str:
    """Returns the verdict as a JUnit document: one test case for the answer as a whole, and one for each finding. An
    answer that waits for a person is skipped; a fault of the grader is an error, and no failure."""
    verdict = graded.verdict
    name = f"{graded.quiz.id}.{graded.question.id}"
    seconds = f"{verdict.timing_ms.get('total', 0.0) / 1000:.3f}"
    suite = ElementTree.Element("testsuite", name=name, time=seconds)
    properties = ElementTree.SubElement(suite, "properties")
    for key in ("points", "max_points", "content_digest", "submission_digest"):
        ElementTree.SubElement(properties, "property", name=key, value=str(getattr(verdict, key)))
    diagnosis = "\n".join(filter(None, (verdict.diagnosis, graded.summary)))
    case = add_case(suite, name, graded.title, seconds)
    if (kind := name_outcome(verdict.status)) is not None:
        tell(case, kind, diagnosis, verdict.status.value)
    for title, finding in graded.findings:
        finding_case = add_case(suite, name, f"{graded.title}: {title}", "0.000")
        if finding.passed is None:
            tell(finding_case, "skipped", graded.describe(finding) or UNDECIDED)
        elif not finding.passed:
            tell(finding_case, "failure", graded.describe(finding) or finding.title, "finding")
    for tag, text in (("system-out", verdict.stdout), ("system-err", verdict.stderr)):
        if text:
            ElementTree.SubElement(suite, tag).text = legal(text)
    return build_document(suite, seconds)


def name_outcome(status: Status) -> str | None:
    """Returns the element that says how the answer as a whole went; None if it is right."""
    special = {Status.CORRECT: None, Status.NEEDS_REVIEW: "skipped", Status.GRADER_FAULT: "error"}
    return special.get(status, "failure")


def add_case(suite: ElementTree.Element, classname: str, name: str, seconds: str) -> ElementTree.Element:
    """Adds a test case to the suite."""
    return ElementTree.SubElement(suite, "testcase", classname=classname, name=legal(name), time=seconds)


def tell(case: ElementTree.Element, kind: str, text: str, of_type: str = "") -> None:
    """Adds the outcome to a test case; the text is both attribute and content, since readers know only one of them."""
    attributes = {"message": legal(text.partition("\n")[0])} | ({"type": of_type} if of_type else {})
    ElementTree.SubElement(case, kind, attributes).text = legal(text)


def build_document(suite: ElementTree.Element, seconds: str) -> str:
    """Returns the whole document, with the counts that readers compare."""
    counts = {"tests": str(len(suite.findall("testcase")))}
    for kind, plural in zip(KINDS, ("failures", "errors", "skipped"), strict=True):
        counts[plural] = str(len(suite.findall(f"testcase/{kind}")))
    suite.attrib.update(counts)
    del counts["skipped"]
    root = ElementTree.Element("testsuites", {"name": "grader", "time": seconds, **counts})
    root.append(suite)
    ElementTree.indent(root)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{ElementTree.tostring(root, encoding="unicode")}'


def legal(text: str) -> str:
    """Returns the text without the characters that XML cannot hold."""
    return ILLEGAL.sub("\ufffd", text)
