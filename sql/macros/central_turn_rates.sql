-- needs: wrap_angle
-- Rates of change [rad/s] of a list of angles at times [s]: from the observation before to the one after, one-sided
-- at the ends, 0 for a single observation.
CREATE MACRO central_turn_rates(angles, seconds) AS list_transform(
    range(1, len(angles) + 1),
    lambda i: coalesce(
        wrap_angle(angles[least(i + 1, len(angles))] - angles[greatest(i - 1, 1)])
        / nullif(seconds[least(i + 1, len(angles))] - seconds[greatest(i - 1, 1)], 0),
        0
    )
);
