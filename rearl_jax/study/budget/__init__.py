"""Error budget of a scene set: what each component of a simulation contributes to the reduction of its errors."""
