"""The residual task: an agent corrects the thrust of a base policy."""
