"""Gymnasium and PettingZoo interfaces of simulated worlds, and their configuration."""
