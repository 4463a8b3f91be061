"""Runs inside the cell. Trusted until the student's source arrives; imports nothing else of the grader."""
