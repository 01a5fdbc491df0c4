"""Simulated against measured scenes: rollouts, reference rows, intervals, tables, figures, one page."""
