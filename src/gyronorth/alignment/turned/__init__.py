"""Multi-position alignment: still poses, the turns between them, and the fit of both.

`segments` finds them, `model` is the law of what they show, `fit` the estimate, `bound` what a plan can reach.
"""
