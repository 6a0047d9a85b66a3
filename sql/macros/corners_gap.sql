-- needs: corner_gap
-- Square of the smallest distance [m^2] from the corners of the second box to the first, which is centred at the origin
-- along x. `c` and `s` are the cosine and the sine of the second's rotation. Without lists, which take ten times as long.
CREATE MACRO corners_gap(ahead, "left", c, s, length1, width1, length2, width2) AS
least(
    corner_gap(ahead + (length2 * c - width2 * s) / 2, "left" + (length2 * s + width2 * c) / 2, length1, width1),
    corner_gap(ahead + (length2 * c + width2 * s) / 2, "left" + (length2 * s - width2 * c) / 2, length1, width1),
    corner_gap(ahead - (length2 * c - width2 * s) / 2, "left" - (length2 * s + width2 * c) / 2, length1, width1),
    corner_gap(ahead - (length2 * c + width2 * s) / 2, "left" - (length2 * s - width2 * c) / 2, length1, width1)
);
