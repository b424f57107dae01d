"""Reports: pages, charts, pictures and tables made from results.

In: result documents and runs. Out: self-contained HTML pages, pictures and terminal tables.
"""
