"""socket(31, SOCK_RAW)."""

import socket

socket.socket(31, socket.SOCK_RAW)
