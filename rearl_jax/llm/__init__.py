"""Language model: questions, requests to the server, and parsing of answers."""
