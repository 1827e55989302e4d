"""Atari games, preprocessed as agents are trained on them."""
