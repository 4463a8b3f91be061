"""The host's /tmp."""

open("/tmp/trap", "w")
