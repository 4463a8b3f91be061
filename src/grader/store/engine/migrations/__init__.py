"""Alembic's environment and the migrations. `grader serve` and `grader migrate` apply them."""
