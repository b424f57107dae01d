"""Making the blind benchmark: plan, truths, simulated slides, surveys, seals."""
