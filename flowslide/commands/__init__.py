"""The commands, one module each: `add_parser(subparsers)` and `run(arguments)`.

In: a command line. Out: files, tables and an exit code. Nothing is imported before it is needed.
"""
