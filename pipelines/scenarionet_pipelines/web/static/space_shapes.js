// Shapes of objects in a unit box (x ahead, y left, z up, standing on 0), as flat triangles: place, normal, glass.

const car = [[0.5, 0.16], [0.5, 0.5], [0.46, 0.56], [0.24, 0.64], [0.06, 0.98], [-0.3, 1], [-0.44, 0.66], [-0.5, 0.6], [-0.5, 0.16]];
const glassFrom = [3, 5]; // edges of the profile that are the windscreen and the rear window

export function shapes() {
  return { car: extruded(car, glassFrom), box: pillar(4, Math.PI / 4, Math.SQRT1_2, 1), pillar: pillar(8, 0, 0.5, 0.6), flat: flat() };
}

// A profile in x and z across the whole width, narrower at the roof.
function extruded(profile, glass) {
  const found = [];
  const at = ([x, z], side) => [x, side * (z > 0.7 ? 0.4 : 0.5), z];
  profile.forEach((point, k) => {
    const next = profile[(k + 1) % profile.length];
    const isGlass = glass.includes(k) ? 1 : 0;
    face(found, [at(point, -1), at(point, 1), at(next, 1), at(next, -1)], isGlass);
  });
  for (const side of [1, -1]) {
    const middle = [0, side * 0.5, 0.3];
    profile.forEach((point, k) => {
      const corners = [middle, at(point, side), at(profile[(k + 1) % profile.length], side)];
      face(found, side > 0 ? corners : corners.reverse(), 0);
    });
    const window = [[0.2, 0.66], [0.05, 0.93], [-0.28, 0.94], [-0.38, 0.68]].map(([x, z]) => [x, side * (z > 0.7 ? 0.42 : 0.49), z]);
    face(found, side > 0 ? window : window.reverse(), 1);
  }
  return new Float32Array(found);
}

// A prism, whose top is a share of its foot.
function pillar(sides, start, radius, taper) {
  const found = [];
  const at = (k, part, z) => {
    const angle = start + (2 * Math.PI * k) / sides;
    return [part * radius * Math.cos(angle), part * radius * Math.sin(angle), z];
  };
  for (let k = 0; k < sides; k++) face(found, [at(k, 1, 0), at(k + 1, 1, 0), at(k + 1, taper, 1), at(k, taper, 1)], 0);
  face(found, [...Array(sides).keys()].map((k) => at(k, taper, 1)), 0);
  return new Float32Array(found);
}

function flat() {
  const found = [];
  face(found, [[-0.5, -0.5, 0], [0.5, -0.5, 0], [0.5, 0.5, 0], [-0.5, 0.5, 0]], 0);
  return new Float32Array(found);
}

// Append a plane polygon, counter-clockwise seen from outside.
function face(found, corners, glass) {
  const [a, b, c] = corners;
  const [u, v] = [b.map((value, k) => value - a[k]), c.map((value, k) => value - a[k])];
  const normal = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
  const size = Math.hypot(...normal) || 1;
  for (let k = 2; k < corners.length; k++) {
    for (const corner of [a, corners[k - 1], corners[k]]) found.push(...corner, ...normal.map((value) => value / size), glass);
  }
}
