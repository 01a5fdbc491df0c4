"""The observer: prediction errors of a driver model on measured drives, their derivatives, and the fit that minimises
them.
"""
