from .files import ImageInfo, Metadata, encode_image, image_info, read_image, read_indices, read_metadata, write_image
from .frames import Frames, is_animated, read_frames, write_frames
from .pages import Pages, count_pages, read_pages, write_pages
from .tiles import Bands, Form, open_bands, write_bands

__all__ = [
    "Bands",
    "Form",
    "Frames",
    "ImageInfo",
    "Metadata",
    "Pages",
    "count_pages",
    "encode_image",
    "image_info",
    "is_animated",
    "open_bands",
    "read_frames",
    "read_image",
    "read_indices",
    "read_metadata",
    "read_pages",
    "write_bands",
    "write_frames",
    "write_image",
    "write_pages",
]
