"""Outside its directory."""

open("/trap", "w")
