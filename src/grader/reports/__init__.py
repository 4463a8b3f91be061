"""Verdicts in the formats of other graders: Gradescope's results.json, and JUnit XML. They leave out what the policy of
the quiz withholds, as far as the other grader allows that."""

from grader.reports.graded import GradedAnswer
from grader.reports.gradescope import results_json
from grader.reports.junit import junit_xml

__all__ = ["GradedAnswer", "junit_xml", "results_json"]
