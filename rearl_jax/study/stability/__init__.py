"""String stability, flow and collisions of simulated traffic, compared with theory and recordings."""
