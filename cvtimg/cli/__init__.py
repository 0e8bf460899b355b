"""The commands of the command line, one file each.

How a command is added:

1. ``cli/NAME_command.py`` has ``EXAMPLES`` and a function ``NAME``: its parameters are options (common ones in
   `cli.options`, groups of them as ``*, common: options.BatchOptions``), its docstring is the help.
2. It checks what makes no sense, makes a plan (`plan_each`: a task for each input; `plan_one`: one for all, or for
   none), and returns ``run_plan(plan, work, COLUMNS, common)``, which prints, reports and gives the exit status.
3. ``work(task, stopwatch)`` is a function of the module: it reads ``task.source``, writes ``task.outputs`` by option
   (``task.outputs["-o"]``), calls ``stopwatch.lap("read" | "cluster" | "write")`` after each stage, and returns the
   columns of its row; "input", "output" and "seconds" are added, and what it raises fails this input alone.
4. `COMMANDS` in `cli.overview` has its name and its line of ``cvtimg --help``; ``meson.build`` lists the file.
5. Heavy modules are imported in functions, so that ``cvtimg --help`` and wrong usage answer at once.
"""
