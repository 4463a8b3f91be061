"""Upkeep of a database: backup, pruning, erasure of a learner, secrets of the installation. Commands of the operator
call it; the worker prunes with it."""
