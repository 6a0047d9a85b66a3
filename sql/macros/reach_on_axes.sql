-- Largest distance [m] of the centres of two boxes along each axis of on_axes at which the boxes still overlap on it.
CREATE MACRO reach_on_axes(turn, length1, width1, length2, width2) AS
[
    (length1 + abs(cos(turn)) * length2 + abs(sin(turn)) * width2) / 2,
    (width1 + abs(sin(turn)) * length2 + abs(cos(turn)) * width2) / 2,
    (length2 + abs(cos(turn)) * length1 + abs(sin(turn)) * width1) / 2,
    (width2 + abs(sin(turn)) * length1 + abs(cos(turn)) * width1) / 2
];
