"""Palette files, a format a module: ``read(content)`` gives the colors in it, ``write(swatches)`` the bytes of one."""
