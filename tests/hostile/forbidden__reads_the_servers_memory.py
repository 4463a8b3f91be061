"""The server's memory by /proc."""

import target

print(open(f"/proc/{target.SERVER}/mem", "rb"))
