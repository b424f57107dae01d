"""The estimator of the project: from measurements and a forward model to unknowns and their errors.

The back-analysis fits parameters to the survey; the diagnosis fits parameters and amplitudes of
effects with the model's own error in the covariance. Both are made of the same parts:

    unknowns    parameters and amplitudes, scaled, and what is known of them beforehand
    data        measured numbers, their roles, covariance and whitening (covariance, hold_out)
    forward     what a forward engine is asked, and what it predicts
    misfit      data and unknowns as one sum of squares, or the paper's loss; its uncertainty
    derivatives, response_surface, budget   what the forward runs say, and how many may be asked for
    search, gauss_newton, lbfgsb, surface_search    optimisers
    calibrate   from a first guess to the answer: scan, search, smoothing; flow_limit: nothing ran
"""
