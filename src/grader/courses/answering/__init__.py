"""Handing in: what a learner may do and see at a question, answers that are stored, and the results that count. A
result is updated in the transaction of every verdict."""
