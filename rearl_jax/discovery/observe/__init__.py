"""The observer: what a driver model fails to predict of measured drivers, its derivatives, and the fit to it."""
