"""Benchmarks that anyone can repeat: run time against error, stability to the limit, and what skipping saves."""

from grader.bench.run import run

__all__ = ["run"]
