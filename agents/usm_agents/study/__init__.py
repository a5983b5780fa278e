"""The study of residual agents: trainings, their scores, what follows, tables and figures."""
