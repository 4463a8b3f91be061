"""The disk itself."""

print(open("/dev/vda", "rb").read(512))
