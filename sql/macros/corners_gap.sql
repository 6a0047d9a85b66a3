-- Smallest distance [m] from the corners of the second box to the first, which is centred at the origin along x.
CREATE MACRO corners_gap(ahead, "left", turn, length1, width1, length2, width2) AS
list_min(
    list_transform(
        [[1, 1], [1, -1], [-1, 1], [-1, -1]],
        lambda side: sqrt(
            greatest(abs(ahead + (side[1] * length2 * cos(turn) - side[2] * width2 * sin(turn)) / 2) - length1 / 2, 0) ** 2
            + greatest(abs("left" + (side[1] * length2 * sin(turn) + side[2] * width2 * cos(turn)) / 2) - width1 / 2, 0) ** 2
        )
    )
);
