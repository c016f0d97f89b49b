"""Which hypotheses are fitted, and in what order."""
