"""Classical back-analyses of a flow slide: limit equilibrium, Kinetics, ZIF and IMM.

In: a section before the slide (`geometry.scenes.scene.Scene`), the surface after it (surveyed,
constructed or simulated), a slip surface, and the judgement calls of an analyst
(`judgement.Judgement`).
Out: for every method the residual strength S_r, its range over the judgement calls, and the
histories behind it (`analysis.analyse`, `flowslide classical CASE`).

    section  ->  slices  ->  limit_equilibrium  ->  search
    section  ->  morph   ->  slide_forces       ->  kinetics, zif, imm  ->  analysis  ->  command

In the paper: its review of back-analysis methods. Assumptions: docs/method/classical.md.
"""
