"""Shared by all stages: files, errors, progress, random numbers, and the settings of all stages.

In: YAML files and command lines. Out: a validated configuration, files that are either whole or
absent, a record of how each result was made. The paper has no counterpart of this package.

`cli` (command lines, exit codes), `config` (the settings of all stages), `files` (atomic files,
checked YAML and JSON), `text_files` (text that is handed in), `out_folder` (a folder of results,
tried beforehand), `manifest` (provenance), `processes` (other Pythons, started safely), `extras`
(optional parts of the installation), `progress` (a bar or a log), `page` (one page of HTML).
Imports nothing of flowslide's other packages.
"""

__version__ = "0.2.0"
