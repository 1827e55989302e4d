"""Renderings of explanations: text, and pictures."""
