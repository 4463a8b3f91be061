"""Assembles and runs the service: the app, its processes, the worker, deliveries, monitoring."""
