"""The commands of the command line, one file each.

How a command is added:

1. A module of `cvtimg.options` has its options under its name in capitals, each a record: what it takes, its default
   and help, what it needs and excludes; ``_MODULES`` in ``cvtimg/options/__init__.py`` says which module.
2. ``cli/NAME_command.py`` has ``EXAMPLES``, the ``COLUMNS`` of the table, named as in --json and of 80 characters at
   most, and a function ``NAME`` of the values of the options; its docstring is the help.
3. The function makes a plan (`plan_of`: a task for each input, or with ``together`` one for all, or without inputs)
   and returns ``planned(plan, work, COLUMNS, given)``: `main` runs it, which prints, reports and gives the exit status.
4. ``work(task, stopwatch, given)`` is a function of the module, or ``late("cli.MODULE", "NAME")`` of another, such as
   `cvtimg.cli.restoring`, which is imported when it runs: it reads ``task.source``, writes ``task.outputs`` by option
   (``task.outputs["-o"]``), calls ``stopwatch.lap("read" | "cluster" | "write")`` after each stage, and returns the
   columns of its row; "input", "output" and "seconds" are added, and what it raises fails this input alone.
5. `COMMANDS` in `cli.overview` has its name and its line of ``cvtimg --help``.
6. Heavy modules are imported in functions, so that ``cvtimg --help`` and wrong usage answer at once.
"""
