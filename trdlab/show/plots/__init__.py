"""Pictures: axes in, axes out, in one style."""
