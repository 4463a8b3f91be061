"""Courses: what may be answered and seen when, what counts, reviews by rubric, statistics, the gradebook.

API, pages and platforms all decide by this room; it knows no HTTP.
"""
