"""The blind benchmark: sealed truths, a judge that sees the survey alone, a score that opens them.

In: sections and a plan (`hidden_effects/`). Out: case folders with sealed truths (`make`), a digest
of a verdict for each (`run`), and the score with its page (`score`). Nothing heavy is loaded here.
"""
