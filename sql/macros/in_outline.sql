-- Whether a point (px, py) lies inside a polygon, by the even-odd rule; `xs` and `ys` are its corners, implicitly
-- closed.
CREATE MACRO in_outline(px, py, xs, ys) AS
len(list_filter(
    range(1, len(xs) + 1),
    lambda i: (ys[i] > py) <> (ys[i % len(ys) + 1] > py)
        AND px < xs[i] + (py - ys[i]) * (xs[i % len(xs) + 1] - xs[i]) / (ys[i % len(ys) + 1] - ys[i])
)) % 2 = 1;
