"""Error budget of simulated scenes: what each component of a simulation contributes to the reduction of the errors."""
