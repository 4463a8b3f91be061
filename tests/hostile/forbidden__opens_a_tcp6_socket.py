"""socket(AF_INET6, SOCK_STREAM)."""

import socket

socket.socket(socket.AF_INET6, socket.SOCK_STREAM)
