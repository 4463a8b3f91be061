"""The machine's devices."""

print(open("/sys/kernel/notes", "rb").read())
