"""Detection: simulated traffic against representative scenes -> who needs a decision."""
