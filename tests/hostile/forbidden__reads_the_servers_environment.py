"""Secrets in the server's environment."""

import target

print(open(f"/proc/{target.SERVER}/environ").read())
