-- needs: segment_gap
-- The segment of a line that is nearest to a point (px, py): its distance `gap` [m], how far the point is to its
-- left (`aside` [m]), and its direction (`heading` [rad]). `xs` and `ys` are the line's points.
CREATE MACRO nearest_segment(px, py, xs, ys) AS list_min(list_transform(
    range(1, len(xs)),
    lambda i: {
        'gap': segment_gap(px - xs[i], py - ys[i], xs[i + 1] - xs[i], ys[i + 1] - ys[i]),
        'aside': (
            (xs[i + 1] - xs[i]) * (py - ys[i]) - (ys[i + 1] - ys[i]) * (px - xs[i])
        ) / greatest(sqrt((xs[i + 1] - xs[i]) ** 2 + (ys[i + 1] - ys[i]) ** 2), 1e-9),
        'heading': atan2(ys[i + 1] - ys[i], xs[i + 1] - xs[i])
    }
));
