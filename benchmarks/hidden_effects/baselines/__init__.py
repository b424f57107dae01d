"""Other ways to name what a model lacks, on the same slides: a score needs a scale.

`slide.py` keeps what a diagnosis knows of a slide near the fit of its base model; `answers.py`,
`discrepancy.py` and `classifier.py` answer from that alone; `curve.py` holds all answers against
the truths; `run.py` goes through a set.
"""
