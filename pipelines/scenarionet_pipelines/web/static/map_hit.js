// Find the map feature at a point: the nearest line within reach, otherwise the lane or area around it.

import { list } from "/static/map_layer.js";

export class MapHit {
  constructor(scene) {
    this.scene = scene;
    this.boxes = scene.features.map((feature, row) => box(list(scene.linePoints, scene.lineOffsets, row), list(scene.areaPoints, scene.areaOffsets, row)));
  }

  // Return the row of the feature, -1 for none. `reach` is in metres; `isShown` selects visible kinds.
  at(x, y, reach, isShown) {
    const { scene } = this;
    let nearest = -1;
    let distance = reach;
    let around = -1;
    for (let row = 0; row < scene.features.length; row++) {
      const b = this.boxes[row];
      const { kind } = scene.features[row];
      if (x < b[0] - reach || y < b[1] - reach || x > b[2] + reach || y > b[3] + reach || !isShown(kind)) continue;
      const points = list(scene.linePoints, scene.lineOffsets, row);
      const outline = list(scene.areaPoints, scene.areaOffsets, row);
      if (outline.length > 4 && contains(outline, x, y)) around = around < 0 || kind !== "area" ? row : around;
      if (kind === "lane") continue;
      const away = apart(points, x, y);
      if (away < distance) [nearest, distance] = [row, away];
    }
    return nearest >= 0 ? nearest : around;
  }
}

function box(...lists) {
  const found = [Infinity, Infinity, -Infinity, -Infinity];
  for (const points of lists) {
    for (let k = 0; k < points.length; k += 2) {
      found[0] = Math.min(found[0], points[k]);
      found[1] = Math.min(found[1], points[k + 1]);
      found[2] = Math.max(found[2], points[k]);
      found[3] = Math.max(found[3], points[k + 1]);
    }
  }
  return found;
}

// Distance from a point to a polyline; infinite if it has no points.
function apart(points, x, y) {
  let best = points.length === 2 ? Math.hypot(points[0] - x, points[1] - y) : Infinity;
  for (let k = 2; k < points.length; k += 2) {
    const ax = points[k - 2];
    const ay = points[k - 1];
    const dx = points[k] - ax;
    const dy = points[k + 1] - ay;
    const along = Math.min(1, Math.max(0, ((x - ax) * dx + (y - ay) * dy) / (dx * dx + dy * dy || 1)));
    best = Math.min(best, Math.hypot(ax + along * dx - x, ay + along * dy - y));
  }
  return best;
}

function contains(outline, x, y) {
  let isInside = false;
  for (let k = 0, before = outline.length - 2; k < outline.length; before = k, k += 2) {
    const isBetween = outline[k + 1] > y !== outline[before + 1] > y;
    if (isBetween && x < ((outline[before] - outline[k]) * (y - outline[k + 1])) / (outline[before + 1] - outline[k + 1]) + outline[k]) isInside = !isInside;
  }
  return isInside;
}
