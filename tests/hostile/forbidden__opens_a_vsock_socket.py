"""socket(AF_VSOCK, SOCK_STREAM)."""

import socket

socket.socket(socket.AF_VSOCK, socket.SOCK_STREAM)
