"""File capabilities."""

import os

open("x", "w").close()
os.setxattr("x", "user.evil", b"1")
