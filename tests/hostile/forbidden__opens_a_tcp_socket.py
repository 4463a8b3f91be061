"""socket(AF_INET, SOCK_STREAM)."""

import socket

socket.socket(socket.AF_INET, socket.SOCK_STREAM)
