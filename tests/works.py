"""Work for batches in worker processes, which import it by name."""

import os
import signal
import sys
import time

from cvtimg.batch.tasks import Row, Stopwatch, Task
from cvtimg.files.whole import whole_file


def copy(task: Task, stopwatch: Stopwatch) -> Row:
    """Copy the input to all outputs."""
    for path in task.outputs.values():
        with whole_file(path) as file:
            file.write(task.source.read_bytes())
    return {"width": 1000, "height": 1000, "reads": "cvtimg.pictures.files" in sys.modules}


def copy_or_die(task: Task, stopwatch: Stopwatch) -> Row:
    """Copy, unless the input says that the process shall be killed."""
    if task.source.read_bytes() == b"die":
        os.kill(os.getpid(), signal.SIGKILL)
    return copy(task, stopwatch)


def copied_then_interrupted(task: Task, stopwatch: Stopwatch) -> Row:
    """Copy, and be interrupted before anyone hears of it."""
    copy(task, stopwatch)
    raise KeyboardInterrupt


def half_a_copy(task: Task, stopwatch: Stopwatch) -> Row:
    """Begin to write, and go on for ever."""
    with whole_file(task.outputs["copy"]) as file:
        file.write(b"half")
        file.flush()
        while True:
            time.sleep(0.01)


def threads(task: Task, stopwatch: Stopwatch) -> Row:
    """Tell the number of threads."""
    from cvtimg._shared.threads import n_threads

    return {"threads": n_threads(), "process": os.getpid()}


def unsendable(task: Task, stopwatch: Stopwatch) -> Row:
    """Return what cannot go back to the process that asked."""
    return {"what": lambda: None}
