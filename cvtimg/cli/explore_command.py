"""``cvtimg explore``: a page in the browser."""

from functools import partial
from importlib.util import find_spec
from pathlib import Path

from cvtimg._shared.extras import needs
from cvtimg.batch.report import complain, reason
from cvtimg.batch.tasks import WrongUsageError
from cvtimg.options.record import Given

EXAMPLES = """\
  cvtimg explore photo.jpg
  cvtimg explore scan_1.png scan_2.png scan_3.png
  cvtimg explore --port 8000 --no-browser
"""


def explore(given: Given) -> int:
    """See results while choosing: a page in the browser, served by this machine for this machine alone.

    Prints the address of the page. Everything stays here: the page loads nothing from elsewhere, and sends nothing
    elsewhere. The server ends with Ctrl-C, or 15 minutes after its last page was closed.
    """
    from cvtimg import find_images

    for name in ("starlette", "uvicorn", "websockets", "psutil"):
        if find_spec(name) is None:
            raise WrongUsageError(f"explore needs {needs(name, 'explore')}")
    paths: list[Path] = []
    n_failed = 0
    for text in given.inputs or []:
        try:
            paths += find_images(text)
        except OSError as error:
            n_failed += 1
            complain(f"{text}: {reason(text, error)}")
    if n_failed and not paths:
        return 1
    from cvtimg.explore import serve

    serve(paths, port=given.port, browser=not given.no_browser, keep=not given.no_store, say=partial(print, flush=True))
    return int(n_failed > 0)
