"""Grading: answers and evidence in, verdicts out. Pure."""
