"""Alembic's environment and the migrations. `grader serve` applies them when it starts, `grader migrate` in either
direction."""
