"""The words of the service: Quiz, Question, Submission, Job, RunReport, Verdict. Pure data."""
