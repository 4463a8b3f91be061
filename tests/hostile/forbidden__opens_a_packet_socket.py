"""socket(AF_PACKET, SOCK_RAW)."""

import socket

socket.socket(socket.AF_PACKET, socket.SOCK_RAW)
