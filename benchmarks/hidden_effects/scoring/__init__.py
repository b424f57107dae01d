"""Scoring the blind benchmark: records, figures, page."""
