"""Commands of the diagnosis: which physical effect does the model of a case lack?"""
