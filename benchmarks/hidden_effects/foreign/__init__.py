"""Truth by codes that share no line with the solver of the judge.

In: a scene and what is hidden in it (`hidden`). Out: a `slide.Slide`, surveyed by the measurements'
own definitions. A code is a module with the function `simulate`, listed in `slide.SOURCES`.
"""
