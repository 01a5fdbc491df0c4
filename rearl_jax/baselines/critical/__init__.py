"""The baseline CRITICAL: traffic of several classes of drivers, whose shares are adapted before the evaluation.

Source: github.com/zachtian/CRITICAL, a loop in which a language model rewrites the configuration of the traffic.
"""
