"""Palette formats, one per module: ``read(content)`` returns the colors, ``write(swatches)`` the bytes of a file."""
