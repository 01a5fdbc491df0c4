"""Detection: compares simulated traffic with representative scenes and marks the vehicles that need a decision."""
