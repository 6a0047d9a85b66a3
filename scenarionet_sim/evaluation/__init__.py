"""Closed-loop evaluation of policies, and observations along the log, stored in the lake."""
