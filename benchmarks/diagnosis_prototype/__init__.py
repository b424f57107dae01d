"""How often the diagnosis is right, measured on a flow slide that costs a millisecond.

`slide` is the slide: a lumped body that spreads, with fourteen effects that may be hidden, with
noise that depends on a seed, and an error that depends on a cell size. `model` shows it to the
diagnosis, `cases` makes blind cases whose truth is known, and
`python -m benchmarks.diagnosis_prototype` diagnoses them and counts. It stands in for the material
point method only to test the statistics on many hundreds of cases.
"""
