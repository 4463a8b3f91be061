"""The zygote's environment."""

print(open("/proc/1/environ", "rb").read())
