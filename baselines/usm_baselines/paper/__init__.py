"""The paper's results: its laws at its own step, Table 1, figures, Theorem 1."""
