"""A policy over a whole database: rollouts, their metrics and what agents observed, as tables of the lake."""
