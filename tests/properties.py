"""How property tests run: a busy machine must not fail them."""

from hypothesis import HealthCheck, settings

patient = settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])
"""Without limits of wall-clock time, for one example and for drawing them."""
