"""The verbs of the package, which offers them itself: make an agent, and ask about it."""
