"""Routes of learners: quizzes, submissions with their events, and labs. A learner sees only their own work, redacted by
the policy of the quiz."""
