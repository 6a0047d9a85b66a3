// The map: surfaces, crosswalks, lane lines in their real colours and dashes, edges, lane directions.
// Drawn into an off-screen canvas larger than the view, which is reused until the view leaves it.

const margin = 0.35; // of the off-screen canvas beyond each side of the view
const slow = 30; // [ms] a map that takes longer is not redrawn during a zoom

export class MapLayer {
  constructor(scene, style, layers) {
    this.style = style;
    this.layers = layers;
    this.paths = build(scene, style);
    this.canvas = document.createElement("canvas");
    this.shown = null; // camera and pixel ratio of the off-screen canvas
    this.took = 0;
  }

  // Discard the off-screen canvas, for example when a layer is toggled.
  forget() {
    this.shown = null;
  }

  // Paint the view; returns true if it has to be redrawn once the camera rests.
  paint(context, camera, ratio, isMoving) {
    const isSharp = this.shown && this.shown.scale === camera.scale && this.shown.ratio === ratio;
    const isCovered = this.shown && covers(this.shown, camera);
    const mayWait = isMoving && this.shown && this.took > slow;
    if (!(isSharp && isCovered) && !mayWait) this.draw(camera, ratio);
    const { x, y, scale, width, height } = this.shown;
    const factor = camera.scale / scale;
    const left = camera.width / 2 + (x - camera.x) * camera.scale - (width * factor) / 2;
    const top = camera.height / 2 - (y - camera.y) * camera.scale - (height * factor) / 2;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.fillStyle = this.style.ground;
    context.fillRect(0, 0, camera.width, camera.height);
    const snap = (value) => (factor === 1 ? Math.round(value * ratio) / ratio : value);
    context.drawImage(this.canvas, snap(left), snap(top), width * factor, height * factor);
    return mayWait && !(isSharp && isCovered);
  }

  draw(camera, ratio) {
    const started = performance.now();
    const width = camera.width * (1 + 2 * margin);
    const height = camera.height * (1 + 2 * margin);
    this.canvas.width = Math.ceil(width * ratio);
    this.canvas.height = Math.ceil(height * ratio);
    this.shown = { x: camera.x, y: camera.y, scale: camera.scale, ratio, width: this.canvas.width / ratio, height: this.canvas.height / ratio };
    const context = this.canvas.getContext("2d", { alpha: false });
    context.fillStyle = this.style.ground;
    context.fillRect(0, 0, this.canvas.width, this.canvas.height);
    const s = camera.scale * ratio;
    context.setTransform(s, 0, 0, -s, this.canvas.width / 2 - s * camera.x, this.canvas.height / 2 + s * camera.y);
    this.drawAll(context, camera.scale);
    this.took = performance.now() - started;
  }

  drawAll(context, scale) {
    const { style, layers, paths } = this;
    const thin = (width) => Math.max(width, 0.8 / scale);
    context.lineJoin = "round";
    if (layers.roads) {
      context.fillStyle = context.strokeStyle = style.road;
      context.fill(paths.surfaces);
      stroke(context, paths.surfaces, thin(0.1));
    }
    if (layers.crosswalks) for (const crosswalk of paths.crosswalks) zebra(context, crosswalk, style);
    if (layers.direction && scale > 1.5) {
      context.strokeStyle = style.arrow;
      stroke(context, paths.arrows, thin(0.3));
    }
    if (layers.lines) {
      for (const [color, isBroken, path] of paths.lines) {
        context.strokeStyle = style[color];
        context.setLineDash(isBroken ? style.dashes : []);
        stroke(context, path, thin(style.lineWidth));
      }
      context.setLineDash([]);
      context.strokeStyle = style.white;
      stroke(context, paths.stops, thin(style.stopLineWidth));
    }
    if (layers.edges) {
      context.strokeStyle = style.edge;
      stroke(context, paths.edges, thin(1.2 * style.lineWidth));
    }
  }
}

function covers(shown, camera) {
  const factor = shown.scale / camera.scale;
  return (
    Math.abs(camera.x - shown.x) * shown.scale <= (shown.width - camera.width * factor) / 2 &&
    Math.abs(camera.y - shown.y) * shown.scale <= (shown.height - camera.height * factor) / 2
  );
}

function stroke(context, path, width) {
  context.lineWidth = width;
  context.stroke(path);
}

// Build one path per style.
function build(scene, style) {
  const paths = { surfaces: new Path2D(), arrows: new Path2D(), edges: new Path2D(), stops: new Path2D(), crosswalks: [] };
  const painted = {};
  scene.features.forEach((feature, row) => {
    const points = list(scene.linePoints, scene.lineOffsets, row);
    const outline = list(scene.areaPoints, scene.areaOffsets, row);
    if (feature.kind === "lane") {
      if (outline.length > 4) trace(paths.surfaces, counterClockwise(outline), true);
      arrows(paths.arrows, points, style.arrowEvery);
    } else if (feature.kind === "line") {
      const color = feature.type.includes("YELLOW") ? "yellow" : "white";
      for (const [left, isBroken] of strokes(feature.type, style.lineWidth)) {
        const path = (painted[`${color}${isBroken}`] ??= [color, isBroken, new Path2D()])[2];
        trace(path, left ? beside(points, left) : points);
      }
    } else if (feature.kind === "edge") trace(paths.edges, points);
    else if (feature.kind === "stop") trace(paths.stops, points);
    else if (feature.kind === "crosswalk") paths.crosswalks.push(outline.length > 4 ? outline : points);
    else if (outline.length > 4) trace(paths.surfaces, counterClockwise(outline), true);
  });
  paths.lines = Object.values(painted);
  return paths;
}

export function list(points, offsets, row) {
  return points.subarray(2 * offsets[row], 2 * offsets[row + 1]);
}

function trace(path, points, isClosed = false) {
  if (points.length < 4) return;
  path.moveTo(points[0], points[1]);
  for (let k = 2; k < points.length; k += 2) path.lineTo(points[k], points[k + 1]);
  if (isClosed) path.closePath();
}

// Orient an outline counter-clockwise: in one path, overlaps of opposite orientation would cancel.
function counterClockwise(outline) {
  let doubled = 0;
  for (let k = 0, before = outline.length - 2; k < outline.length; before = k, k += 2) {
    doubled += outline[before] * outline[k + 1] - outline[k] * outline[before + 1];
  }
  if (doubled >= 0) return outline;
  const turned = new Float32Array(outline.length);
  for (let k = 0; k < outline.length; k += 2) turned.set(outline.subarray(outline.length - 2 - k, outline.length - k), k);
  return turned;
}

// Strokes of a lane line: lateral offset to the left [m] and whether it is broken.
export function strokes(type, line) {
  if (type === "ROAD_LINE_PASSING_DOUBLE_YELLOW") return [[line, false], [-line, true]];
  const isBroken = type.includes("BROKEN");
  return type.includes("DOUBLE") ? [[line, isBroken], [-line, isBroken]] : [[0, isBroken]];
}

export function beside(points, left) {
  const moved = new Float32Array(points.length);
  const last = points.length - 2;
  for (let k = 0; k <= last; k += 2) {
    const before = Math.max(0, k - 2);
    const after = Math.min(last, k + 2);
    const dx = points[after] - points[before];
    const dy = points[after + 1] - points[before + 1];
    const length = Math.hypot(dx, dy) || 1;
    moved[k] = points[k] - (left * dy) / length;
    moved[k + 1] = points[k + 1] + (left * dx) / length;
  }
  return moved;
}

// Chevrons along a lane, `every` metres apart.
function arrows(path, points, every) {
  let next = every / 4;
  for (let k = 2; k < points.length; k += 2) {
    const dx = points[k] - points[k - 2];
    const dy = points[k + 1] - points[k - 1];
    const length = Math.hypot(dx, dy);
    for (; next <= length; next += every) {
      const x = points[k - 2] + (dx * next) / length;
      const y = points[k - 1] + (dy * next) / length;
      const ux = dx / length;
      const uy = dy / length;
      path.moveTo(x - 1.2 * ux - 0.7 * uy, y - 1.2 * uy + 0.7 * ux);
      path.lineTo(x, y);
      path.lineTo(x - 1.2 * ux + 0.7 * uy, y - 1.2 * uy - 0.7 * ux);
    }
    next -= length;
  }
}

// Draw a crosswalk as a broad dashed line along its longest side, clipped to its outline.
function zebra(context, outline, style) {
  if (outline.length < 6) return;
  const path = new Path2D();
  trace(path, outline, true);
  let best = [0, 1, 0, 0]; // length, direction
  let x = 0;
  let y = 0;
  for (let k = 0; k < outline.length; k += 2) {
    const after = (k + 2) % outline.length;
    const dx = outline[after] - outline[k];
    const dy = outline[after + 1] - outline[k + 1];
    const length = Math.hypot(dx, dy);
    if (length > best[0]) best = [length, dx / length, dy / length];
    x += (2 * outline[k]) / outline.length;
    y += (2 * outline[k + 1]) / outline.length;
  }
  const [length, ux, uy] = best;
  context.save();
  context.clip(path);
  context.strokeStyle = style.white;
  context.globalAlpha = 0.85;
  context.lineWidth = 2 * length;
  context.setLineDash(style.stripes);
  context.beginPath();
  context.moveTo(x - length * ux, y - length * uy);
  context.lineTo(x + length * ux, y + length * uy);
  context.stroke();
  context.restore();
}
