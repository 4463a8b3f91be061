"""Runs inside the cell of the jail. Its code is trusted until the student's source arrives, and imports nothing else of
the grader."""
