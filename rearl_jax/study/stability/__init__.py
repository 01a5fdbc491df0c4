"""String stability, flow and collisions of simulated traffic, beside theory and recordings."""
