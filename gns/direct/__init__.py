"""A learned model without steps: section and strengths in, surface after the slide out."""
