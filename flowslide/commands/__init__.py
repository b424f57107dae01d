"""The commands, one module each: `DESCRIPTION`, `add_arguments(parser)` and `run(arguments)`.

In: a command line. Out: files, tables and an exit code. `flowslide.command_line.COMMANDS` lists
them. A module imports nothing heavy before its `run`, so that every `--help` is there at once.
"""
