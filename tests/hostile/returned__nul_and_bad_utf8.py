"""Bytes that are no text."""

import os

os.write(1, b'\x00\xff\xfe\xc0\xaf ok \xed\xa0\x80\n')
