"""socket(AF_INET, SOCK_DGRAM)."""

import socket

socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
