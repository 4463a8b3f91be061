"""Put texts into the right order."""

from grader.questions.kinds.order.kind import Order, OrderQuestion

__all__ = ["Order", "OrderQuestion"]
