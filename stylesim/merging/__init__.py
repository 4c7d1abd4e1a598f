"""Several corpora into one: one clock, splits without leakage, balance by weights, and a sensor's noise.

`merge.merge`, `balance.balance` and `balance.balance_weights` are the functions for users; nothing heavy is
imported before they are.
"""
