"""Reports to instructors: statistics of a quiz, learners who are stuck, what needs a person today. They read stored
results; none changes anything."""
