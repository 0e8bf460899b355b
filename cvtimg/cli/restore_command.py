"""``cvtimg restore``: one good image from several bad ones."""

from pathlib import Path

from cvtimg.batch.pipes import is_pipe, stem_of
from cvtimg.batch.plans import find
from cvtimg.cli.running import Given, Todo, WrongUsageError, plan_of, planned
from cvtimg.options.record import late

EXAMPLES = """\
  cvtimg restore scan_1.png scan_2.png scan_3.png -k 6 -o whole.png
  cvtimg restore photo_*.png --detail --align -o photo.png --sheet sheet.png
  cvtimg restore noisy.png --detail -o clean.png
  cvtimg restore a.tif b.tif --mask a-known.png --mask b-known.png -k 4 -o c.tif --labels c-labels.png
  cvtimg restore day.png night.png --channels -k 12 -o day-12.png
  cvtimg restore film.gif -o clean.gif
"""
COLUMNS = ("input", "versions", "k", "noise_like", "unknown", "energy", "seconds", "output")


def restore(given: Given) -> Todo:
    """Restore one image from several noisy or incomplete versions of it.

    Transparent pixels are missing, and filled from around them. Transparency that all versions share, or a single one
    has, comes back as it was; with --fill-transparent it is filled, too. Where versions disagree, what was added to one
    of them or painted over in it is left out; --hidden changes that. Salt and pepper is filled and stripes are taken
    away. The result has N flat colors; without -k, photographs get their detail back, as with --detail.

    Pages of a file are versions if their axis has no name, or is the one that --merge names. Other pages, such as the
    planes of a stack and the frames of an animation, are restored one by one into a stack, -o FILE.tif, or
    an animation; channels are bands of their pages.
    """
    masks = given.mask or []
    if not given.output and (sources := list(find(given.versions)[0])):
        from cvtimg.pictures.files import suffix_for

        named = f"{stem_of(sources[0])}-restored{suffix_for(sources[0])}"
        given.output = Path(named) if is_pipe(sources[0]) else sources[0].with_name(named)
    plan = plan_of(given, together=True)
    n_versions = sum(len(task.sources) for task in plan.tasks)
    if masks and plan.tasks and len(masks) != n_versions:
        raise WrongUsageError(f"--mask is given {len(masks)} times, for {n_versions} versions")
    return planned(plan, late("cli.restoring", "restored_versions"), COLUMNS, given)
