"""Runs a script on the trials of an exercise in the jail, and judges what it says by simulating them again."""
