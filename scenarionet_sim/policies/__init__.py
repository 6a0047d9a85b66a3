"""Policies: replay of the log, reactive traffic, constant velocity, and external actions.

A policy is a frozen, picklable specification. A simulation takes several, and each object is driven by the last one
that selects it, so the most general comes first: ``(Replay(), Idm(), External())``.
"""
