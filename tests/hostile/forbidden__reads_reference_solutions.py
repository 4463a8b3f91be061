"""The reference solutions."""

import target

print(open(f"{target.CONTENT}/reference_solutions/canary.py").read())
