"""socket(AF_ALG, SOCK_SEQPACKET)."""

import socket

socket.socket(socket.AF_ALG, socket.SOCK_SEQPACKET)
