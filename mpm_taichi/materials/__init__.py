"""Material laws, one file each; `law.MaterialLaw` says what one is.

In: a strain increment. Out: the stress. `docs/your-own-material-law.md` shows how to write one.
"""
