"""A pool of processes."""

import multiprocessing

multiprocessing.get_context("fork").Process(target=print).start()
