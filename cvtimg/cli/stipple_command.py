"""``cvtimg stipple``: images as dots for pen plotters, laser cutters and print."""

from cvtimg.cli.running import Given, Row, Stopwatch, Task, Todo, WrongUsageError, plan_of, planned

EXAMPLES = """\
  cvtimg stipple portrait.jpg -n 20000 -o portrait.svg
  cvtimg stipple photo.jpg --pen 0.4mm --width 200mm --marks points -o a.svg
  cvtimg stipple photo.jpg --paper a4 --landscape --pen 0.3mm --marks line -o line.svg
  cvtimg stipple photo.jpg -n 30000 --pens '#000,#e4002b,#0057b8' --marks points -o pens.svg
  cvtimg stipple photo.jpg -n 8000 --dots sized --radius-range 0.5 4 -o a.png
  cvtimg stipple photo.jpg -n 60000 --layers cmyk -o pens.svg
  cvtimg stipple logo.png -n 3000 --invert --cells cells.geojson -o dots.csv
  cvtimg stipple photos/ -n 20000 --out-dir plots
"""
COLUMNS = ("input", "n", "radius", "max_ink", "energy", "seconds", "output")


def stipple(given: Given) -> Todo:
    """Reproduce the tones of images by dots.

    Drawings are light; with --tones true, they are as bright as the image from afar, scaled by --max-ink. Transparent
    pixels are paper, and no dot lies in white.

    The suffix of -o picks the format: .svg in millimeters with a layer for each pen, .png and other images, or .csv.
    Without -o and --out-dir, one input gives NAME-stippled.svg beside it; with --out-dir each gives NAME.svg.
    """
    if given.radius_range and not 0 < given.radius_range[0] <= given.radius_range[1]:
        raise WrongUsageError("--radius-range: A and B must be > 0, the least first")
    named = "{}.svg" if given.out_dir else "{}-stippled.svg"
    return planned(plan_of(given, named), _stipple, COLUMNS, given)


def _stipple(task: Task, stopwatch: Stopwatch, given: Given) -> Row:
    import cvtimg
    from cvtimg.artwork.stipples import Sheet

    image = cvtimg.read_image(task.source)
    stopwatch.lap("read")
    names = ("width", "height", "paper", "landscape", "margin")
    fitted = {name: getattr(given, name) for name in names}
    scale = Sheet.of(image.shape[:2], **fitted).scale
    diameter = given.pen and given.pen / scale
    result = cvtimg.stipple(image, given.number, **given.arguments | {"dot_diameter": diameter})
    stopwatch.lap("stipple")
    drawing = {"fill": given.fill, "marks": given.marks, "pen_width": given.pen or given.pen_width}
    result.save(task.output, **fitted, **drawing, overwrite=given.overwrite)
    if "--cells" in task.outputs:
        result.save_cells(task.outputs["--cells"], **fitted, overwrite=given.overwrite)
    stopwatch.lap("write")
    row = result.summary()
    row["radius_mm"] = row["radius"] and row["radius"] * scale
    return {"width": image.shape[1], "height": image.shape[0], **row}
