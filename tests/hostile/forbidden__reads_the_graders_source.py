"""How it is checked."""

import target

print(open(f"{target.SOURCE}/sandbox/policy.py").read())
