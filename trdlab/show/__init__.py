"""Renderings of what trdlab tells: text for a terminal, pages, plain data, and pictures."""
