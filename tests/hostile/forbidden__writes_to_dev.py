"""A new file in /dev."""

open("/dev/trap", "w")
