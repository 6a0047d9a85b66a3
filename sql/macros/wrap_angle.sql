-- An angle [rad] in [-pi, pi).
CREATE MACRO wrap_angle(angle) AS angle - 2 * pi() * floor((angle + pi()) / (2 * pi()));
