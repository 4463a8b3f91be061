"""Courses: what may be answered and seen when, what counts, reviews by rubric, statistics, the gradebook."""
