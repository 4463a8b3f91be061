"""Runs inside the cell of the jail. Trusted until the student's source arrives; imports nothing else of ours."""
