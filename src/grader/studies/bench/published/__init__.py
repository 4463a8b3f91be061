"""Computes what docs/measured.md publishes. Its tables and sentences come from the committed results of the studies,
and no number is typed by hand."""
