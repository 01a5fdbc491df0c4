"""Language model: questions, requests to the server, and the reading of answers."""
