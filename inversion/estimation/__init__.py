"""The estimator of the project: from measurements and a forward model to unknowns and their errors.

The back-analysis fits parameters to the survey; the diagnosis fits parameters and amplitudes of
effects with the model's own error in the covariance. Both are made of the same parts:

    unknowns   parameters and amplitudes, scaled, and what is known of them beforehand
    data       measured numbers, their roles, covariance and whitening (covariance, hold_out)
    misfit     data and unknowns as one sum of squares, or the paper's loss
    derivatives, response_surface, budget   what the forward runs say, and how many may be asked for
    search, gauss_newton, lbfgsb, geometric_scan, smoothing, surface_search   optimisers
    posterior  how well the answer is known
"""
