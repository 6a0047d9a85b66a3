-- Distance [m] from a point (x, y) to the line from the origin to (dx, dy).
CREATE MACRO segment_gap(x, y, dx, dy) AS
sqrt(
    (x - least(greatest((x * dx + y * dy) / nullif(dx * dx + dy * dy, 0), 0), 1) * dx) ** 2
    + (y - least(greatest((x * dx + y * dy) / nullif(dx * dx + dy * dy, 0), 0), 1) * dy) ** 2
);
