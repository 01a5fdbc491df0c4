"""The blind study of discovery: independently generated traffic, sealed truths, and scores."""
