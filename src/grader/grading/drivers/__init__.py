"""Texts that run in the jail around a student's module; they import nothing of ours, and nothing here is trusted."""
