"""Comparison of car-following models: the first step of a discovery, which uses the best one."""
