"""A course filled with learners who do not exist, to try the service: made-up answers, with real verdicts."""

from grader.service.demo.filling import DemoFilled, fill_demo

__all__ = ["DemoFilled", "fill_demo"]
