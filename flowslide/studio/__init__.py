"""The studio: a local page to move the strengths of a section and watch it flow.

`app` serves the page (`page/`), `workspace` reads and writes case folders, `bodies` reads cases in
three dimensions, `live` simulates what a slider asks for, `jobs` runs back-analyses and diagnoses
in processes of their own. Whatever is computed is computed by the functions of the commands, so
that its numbers are theirs.
"""
