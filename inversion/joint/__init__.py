"""One relation over several slides: a hierarchical model of the strength ratio.

In: posteriors and back-analyses of single slides. Out: the mean of ln(S_r / sigma'_v0), its scatter
between slides, and the distribution of the ratio of a dam that has not failed (`joint.json`).
"""
