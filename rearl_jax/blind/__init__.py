"""The blind study of discovery: independently generated traffic, its sealed hidden effects, and scores."""
