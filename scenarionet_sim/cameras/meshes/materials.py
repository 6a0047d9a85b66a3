"""Colours of materials and paints."""

from __future__ import annotations

from scenarionet_sim.cameras.draw import codes as at

MATERIAL_COLORS = {
    at.BODY: (0.5, 0.5, 0.5),
    at.GLASS: (0.012, 0.015, 0.02),
    at.TYRE: (0.018, 0.018, 0.018),
    at.HEADLAMP: (0.85, 0.85, 0.80),
    at.TAIL_LAMP: (0.42, 0.015, 0.012),
    at.TRIM: (0.03, 0.03, 0.032),
    at.SKIN: (0.55, 0.32, 0.22),
    at.CLOTH: (0.08, 0.12, 0.28),
    at.TROUSERS: (0.03, 0.035, 0.05),
    at.ORANGE: (0.85, 0.19, 0.02),
    at.REFLECTIVE: (0.80, 0.80, 0.78),
    at.LEAF: (0.055, 0.115, 0.028),
    at.BARK: (0.075, 0.05, 0.032),
    at.FACADE: (0.40, 0.36, 0.31),
    at.ROOF: (0.14, 0.13, 0.13),
    at.METAL: (0.23, 0.24, 0.25),
    at.HOUSING: (0.02, 0.022, 0.02),
    at.LAMP_RED: (0.85, 0.03, 0.02),
    at.LAMP_YELLOW: (0.85, 0.45, 0.02),
    at.LAMP_GREEN: (0.03, 0.75, 0.25),
    at.INTERIOR: (0.02, 0.02, 0.022),
}
"""Linear RGB of each material."""

PAINTS = (
    (0.62, 0.62, 0.61), (0.04, 0.04, 0.045), (0.25, 0.26, 0.27), (0.34, 0.02, 0.02), (0.36, 0.37, 0.36),
    (0.03, 0.08, 0.26), (0.70, 0.70, 0.69), (0.11, 0.115, 0.12), (0.02, 0.10, 0.07), (0.45, 0.44, 0.40),
    (0.10, 0.16, 0.34), (0.55, 0.50, 0.40), (0.16, 0.03, 0.035), (0.38, 0.39, 0.40), (0.06, 0.065, 0.08),
    (0.75, 0.23, 0.02),
    (0.055, 0.120, 0.028), (0.075, 0.135, 0.030), (0.045, 0.100, 0.035), (0.095, 0.130, 0.030),
    (0.42, 0.38, 0.32), (0.30, 0.13, 0.085), (0.52, 0.50, 0.46), (0.36, 0.26, 0.17), (0.24, 0.25, 0.27),
    (0.46, 0.36, 0.22),
)  # fmt: skip
"""Linear RGB of the paints of vehicles, the last one that of the own vehicle alone; then of the leaves of trees (four)
and of the walls of buildings (six)."""
