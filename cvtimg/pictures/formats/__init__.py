"""Formats of image files: opening, decoding and encoding. `cvtimg.pictures` is the public interface."""
