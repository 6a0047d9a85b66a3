-- Rates of change [1/s] of a list of observations at times [s]: from the observation before to the one after, one-sided
-- at the ends, 0 for a single observation.
CREATE MACRO central_rates(v, seconds) AS list_transform(
    range(1, len(v) + 1),
    lambda i: coalesce(
        (v[least(i + 1, len(v))] - v[greatest(i - 1, 1)])
        / nullif(seconds[least(i + 1, len(v))] - seconds[greatest(i - 1, 1)], 0),
        0
    )
);
