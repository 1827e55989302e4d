"""The story of an episode: what was expected all along, what came, and what that changed."""
