"""socket(AF_UNIX, SOCK_STREAM)."""

import socket

socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
