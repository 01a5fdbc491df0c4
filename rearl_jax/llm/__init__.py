"""Language model: what is asked, how it is sent, what is understood of the answer."""
