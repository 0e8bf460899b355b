"""``cvtimg mosaic``: images as convex tiles of one color each."""

from cvtimg.cli.running import Given, Row, Stopwatch, Task, Todo, plan_of, planned

EXAMPLES = """\
  cvtimg mosaic photo.jpg -n 1000 -o photo.svg
  cvtimg mosaic photo.jpg -n 2000 --shape triangles -o lowpoly.png
  cvtimg mosaic photo.jpg -n 500 -k 8 --outline 1.5 -o window.svg
  cvtimg mosaic photos/ -n 1500 --out-dir mosaics
"""
COLUMNS = ("input", "n", "energy", "psnr", "seconds", "output")


def mosaic(given: Given) -> Todo:
    """Turn images into mosaics of N convex, single-colored tiles.

    Tiles move until the mosaic matches the image as closely as possible, so their borders follow its edges.

    The suffix of -o picks the format: .svg, .geojson with a polygon for each tile, or .png and other images. Without
    -o and --out-dir, one input gives NAME-mosaic.png beside it; with --out-dir each gives NAME.png.
    """
    named = "{}.png" if given.out_dir else "{}-mosaic.png"
    return planned(plan_of(given, named), _mosaic, COLUMNS, given)


def _mosaic(task: Task, stopwatch: Stopwatch, given: Given) -> Row:
    import cvtimg

    image = cvtimg.read_image(task.source)
    stopwatch.lap("read")
    result = cvtimg.mosaic(image, **given.arguments)
    stopwatch.lap("mosaic")
    result.save(task.output, outline=given.outline, scale=given.scale, overwrite=given.overwrite)
    stopwatch.lap("write")
    return {"width": image.shape[1], "height": image.shape[0], "shape": given.shape, **result.summary()}
