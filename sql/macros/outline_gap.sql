-- needs: in_outline, segment_gap
-- Distance [m] from a point (px, py) to a polygon, 0 inside; `xs` and `ys` are its corners, implicitly closed.
CREATE MACRO outline_gap(px, py, xs, ys) AS
CASE
    WHEN in_outline(px, py, xs, ys) THEN 0.0
    ELSE list_min(list_transform(
        range(1, len(xs) + 1),
        lambda i: segment_gap(
            px - xs[i], py - ys[i], xs[i % len(xs) + 1] - xs[i], ys[i % len(ys) + 1] - ys[i]
        )
    ))
END;
