-- The points of a line as [x, y], moved to its left (`side` 1) or right (-1) by a distance [m] each: across the line
-- from the point before to the point after. `offsets` has one element for all points, or one for each.
CREATE MACRO sideways(xs, ys, offsets, side) AS list_transform(
    list_transform(
        range(1, len(xs) + 1),
        lambda i: [
            xs[i], ys[i], offsets[least(i, len(offsets))],
            xs[least(i + 1, len(xs))] - xs[greatest(i - 1, 1)], ys[least(i + 1, len(ys))] - ys[greatest(i - 1, 1)]
        ]
    ),
    lambda p: [
        p[1] - side * p[3] * p[5] / greatest(sqrt(p[4] ** 2 + p[5] ** 2), 1e-9),
        p[2] + side * p[3] * p[4] / greatest(sqrt(p[4] ** 2 + p[5] ** 2), 1e-9)
    ]
);
