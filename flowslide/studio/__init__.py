"""The studio: a local page to draw a section, move its strengths and watch it flow.

`app` serves the page (`page/`), `workspace` reads and writes case folders, `live` simulates what a
slider asks for, `jobs` runs back-analyses and diagnoses in processes of their own. Whatever is
computed is computed by `flowslide.api`, so that its numbers are those of the command line.
"""
