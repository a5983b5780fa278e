"""The study of learned agents: trainings, their scores, what follows, tables and figures."""
