"""A result that is too large, properly framed."""

import numpy as np


def main():
    return np.zeros(4_000_000)
