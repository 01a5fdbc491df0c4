"""Decision: vehicles that need one -> admissible actions -> choice of a policy -> execution."""
