-- Square of the distance [m^2] from a point to a box that is centred at the origin along x, 0 inside.
CREATE MACRO corner_gap(ahead, "left", length, width) AS
greatest(abs(ahead) - length / 2, 0.0) * greatest(abs(ahead) - length / 2, 0.0)
+ greatest(abs("left") - width / 2, 0.0) * greatest(abs("left") - width / 2, 0.0);
