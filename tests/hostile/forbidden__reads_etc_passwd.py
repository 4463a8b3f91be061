"""The host's users."""

print(open("/etc/passwd").read())
