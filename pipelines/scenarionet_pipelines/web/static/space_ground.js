// The map as triangles on the ground: surfaces, and paint in the order in which it is drawn.

import { beside, list, strokes } from "/static/map_layer.js";

const plain = -1e9; // along the stripes, for what has none

// Points in the plane with a colour, and triangles between them.
class Mesh {
  constructor() {
    this.points = []; // x, y, distance along the stripes
    this.colors = []; // 4 bytes each
    this.corners = [];
  }

  add(x, y, color, along = plain) {
    this.points.push(x, y, along);
    this.colors.push(...color);
    return this.points.length / 3 - 1;
  }

  // A polygon as triangles from its first point; overlaps of outer and inner ones cancel in the stencil buffer.
  fan(outline, color, along = () => plain) {
    const first = this.points.length / 3;
    for (let k = 0; k < outline.length; k += 2) this.add(outline[k], outline[k + 1], color, along(outline[k], outline[k + 1]));
    for (let k = 2; k < outline.length / 2; k++) this.corners.push(first, first + k - 1, first + k);
  }

  // A line of a width [m]; corners are mitred, so that nothing is drawn twice.
  ribbon(points, width, color) {
    if (points.length < 4) return;
    const left = beside(points, width / 2);
    for (let k = 0; k < points.length; k += 2) {
      const here = this.add(left[k], left[k + 1], color);
      this.add(2 * points[k] - left[k], 2 * points[k + 1] - left[k + 1], color);
      if (k) this.corners.push(here - 2, here - 1, here, here, here - 1, here + 1);
    }
  }

  // A broken line.
  dashes(points, width, color, [dash, gap]) {
    let piece = [];
    let at = 0; // along the pattern
    for (let k = 0; k + 3 < points.length; k += 2) {
      const [dx, dy] = [points[k + 2] - points[k], points[k + 3] - points[k + 1]];
      const length = Math.hypot(dx, dy);
      for (let done = 0; done < length; ) {
        const isPaint = at < dash;
        const step = Math.min(length - done, (isPaint ? dash : dash + gap) - at);
        const place = (part) => [points[k] + (dx * part) / length, points[k + 1] + (dy * part) / length];
        if (isPaint && !piece.length) piece.push(...place(done));
        done += step;
        at += step;
        if (isPaint) piece.push(...place(done));
        if (at >= dash - 1e-6 && piece.length) {
          this.ribbon(piece, width, color);
          piece = [];
        }
        if (at >= dash + gap - 1e-6) at = 0;
      }
    }
    this.ribbon(piece, width, color);
  }
}

export function bytes(color, alpha = 1) {
  return [1, 3, 5].map((k) => Number.parseInt(color.slice(k, k + 2), 16)).concat(Math.round(255 * alpha));
}

// One mesh for each layer that can be switched, and the surfaces.
export function groundOf(scene, style) {
  const meshes = { roads: new Mesh(), crosswalks: new Mesh(), lines: new Mesh(), edges: new Mesh(), route: new Mesh() };
  scene.features.forEach(({ kind, type }, row) => {
    const points = list(scene.linePoints, scene.lineOffsets, row);
    const outline = list(scene.areaPoints, scene.areaOffsets, row);
    if (kind === "line") paint(meshes.lines, points, type, style);
    else if (kind === "stop") meshes.lines.ribbon(points, style.stopLineWidth, bytes(style.white));
    else if (kind === "edge") meshes.edges.ribbon(points, 2 * style.lineWidth, bytes(style.edge));
    else if (kind === "crosswalk") stripes(meshes.crosswalks, outline.length > 4 ? outline : points, style);
    else if (outline.length > 4) meshes.roads.fan(counterClockwise(outline), bytes(style.road));
  });
  meshes.route.ribbon(path(scene, scene.ego), style.routeWidth, bytes(style.ego, 0.35));
  return meshes;
}

// The path of a run's evaluated vehicles.
export function runMesh(run, width) {
  const mesh = new Mesh();
  for (const row of run.judged) mesh.ribbon(path(run, row), width, bytes(run.color, 0.6));
  return mesh;
}

function path(motion, row) {
  const found = [];
  for (let step = 0; step < motion.numSteps; step++) {
    const at = row * motion.numSteps + step;
    const [x, y] = [motion.position[2 * at], motion.position[2 * at + 1]];
    if (motion.valid[at] && !(Math.hypot(x - found.at(-2), y - found.at(-1)) < 0.2)) found.push(x, y);
  }
  return found;
}

function paint(mesh, points, type, style) {
  const color = bytes(type.includes("YELLOW") ? style.yellow : style.white);
  for (const [left, isBroken] of strokes(type, style.lineWidth)) {
    const line = left ? beside(points, left) : points;
    if (isBroken) mesh.dashes(line, style.lineWidth, color, style.dashes);
    else mesh.ribbon(line, style.lineWidth, color);
  }
}

// Stripes across the longest side of an outline.
function stripes(mesh, outline, style) {
  let best = [0, 1, 0];
  for (let k = 0; k < outline.length; k += 2) {
    const after = (k + 2) % outline.length;
    const [dx, dy] = [outline[after] - outline[k], outline[after + 1] - outline[k + 1]];
    const length = Math.hypot(dx, dy);
    if (length > best[0]) best = [length, dx / length, dy / length];
  }
  const period = style.stripes[0] + style.stripes[1];
  mesh.fan(outline, bytes(style.white, 0.85), (x, y) => 1000 + (x * best[1] + y * best[2]) / period);
}

function counterClockwise(outline) {
  let doubled = 0;
  for (let k = 0, before = outline.length - 2; k < outline.length; before = k, k += 2) {
    doubled += outline[before] * outline[k + 1] - outline[k] * outline[before + 1];
  }
  if (doubled >= 0) return outline;
  const turned = [];
  for (let k = outline.length - 2; k >= 0; k -= 2) turned.push(outline[k], outline[k + 1]);
  return turned;
}
