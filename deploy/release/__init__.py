"""`make release`: builds what a release consists of, checks it, and writes its notes. Nothing is uploaded."""
