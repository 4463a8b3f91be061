"""The kernel's memory."""

print(open("/dev/mem", "rb").read(16))
