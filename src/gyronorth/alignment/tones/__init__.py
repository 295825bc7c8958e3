"""Heading under sway, settling and bumps, averaged over models of them.

`search` weighs every model of a fine grid; `proposals` those that a network proposes, by the closed forms of
`evidence`. The two are written independently: the first is the yardstick of the second.
"""
