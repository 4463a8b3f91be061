"""socket(AF_INET, SOCK_RAW)."""

import socket

socket.socket(socket.AF_INET, socket.SOCK_RAW)
