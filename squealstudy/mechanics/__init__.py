"""The mechanics as a library: from a model and values to numbers, in arrays.

No study, no file, no cache, no process. `model.Model` is what `squealstudy.model` gives; `at` makes
it a `system.System`, of one design point or of a batch, whose steps are computed when asked for.
"""
