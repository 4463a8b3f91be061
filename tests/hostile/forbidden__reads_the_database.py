"""Everybody's marks."""

import target

print(open(f"{target.CONTENT}/data/grader.db", "rb").read())
