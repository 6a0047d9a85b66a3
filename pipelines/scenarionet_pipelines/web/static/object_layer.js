// Objects as boxes with headings, trails, the ego's route, traffic lights and labels.

const trail = 2; // [s]
const bands = 5; // levels of fading
const least = 0.8; // minimum side of a drawn box [m], so that pedestrians are visible
const shapes = { s: 4, "^": 3, D: 4, o: 0 };

export class ObjectLayer {
  constructor(scene, style, layers) {
    this.scene = scene;
    this.style = style;
    this.layers = layers;
    this.selected = -1;
    this.there = {};
    this.color = scene.objects.map((object, row) => (row === scene.ego ? style.ego : style.objects[object.type]));
    this.order = [...scene.objects.keys()].filter((row) => row !== scene.ego).concat(scene.ego);
    this.way = this.route();
  }

  paint(context, camera, ratio, moment) {
    camera.apply(context, ratio);
    context.lineJoin = "round";
    if (this.layers.route) this.paintRoute(context, camera);
    if (this.layers.trails) this.paintTrails(context, camera, moment);
    if (this.layers.objects) for (const row of this.order) this.paintBox(context, camera, row, moment);
    if (this.layers.lights) this.paintLights(context, camera, moment.step);
    if (this.layers.names) this.paintNames(context, camera, ratio, moment);
  }

  route() {
    const { scene } = this;
    const path = new Path2D();
    let isDrawing = false;
    for (let step = 0; step < scene.numSteps; step++) {
      const row = scene.ego * scene.numSteps + step;
      const isThere = scene.valid[row] === 1;
      if (isThere) path[isDrawing ? "lineTo" : "moveTo"](scene.position[2 * row], scene.position[2 * row + 1]);
      isDrawing = isThere;
    }
    return path;
  }

  paintRoute(context, camera) {
    context.strokeStyle = this.style.ego;
    context.globalAlpha = 0.3;
    context.lineWidth = Math.max(this.style.routeWidth, 2 / camera.scale);
    context.lineCap = "round";
    context.stroke(this.way);
    context.globalAlpha = 1;
    context.lineCap = "butt";
  }

  // One path per colour and age, so that the number of strokes does not grow with the number of objects.
  paintTrails(context, camera, { step }) {
    const { scene } = this;
    const since = scene.time[step] - trail;
    const paths = new Map();
    let first = step;
    while (first > 0 && scene.time[first - 1] >= since) first--;
    for (let row = 0; row < scene.numObjects; row++) {
      for (let k = Math.max(1, first); k <= step; k++) {
        const at = row * scene.numSteps + k;
        if (!scene.valid[at] || !scene.valid[at - 1]) continue;
        const band = Math.min(bands - 1, Math.floor((bands * (scene.time[k] - since)) / trail));
        const key = `${this.color[row]} ${band}`;
        if (!paths.has(key)) paths.set(key, new Path2D());
        const path = paths.get(key);
        path.moveTo(scene.position[2 * at - 2], scene.position[2 * at - 1]);
        path.lineTo(scene.position[2 * at], scene.position[2 * at + 1]);
      }
    }
    context.lineWidth = Math.max(0.35, 1 / camera.scale);
    for (const [key, path] of paths) {
      const [color, band] = key.split(" ");
      context.strokeStyle = color;
      context.globalAlpha = (0.6 * (Number(band) + 1)) / bands;
      context.stroke(path);
    }
    context.globalAlpha = 1;
  }

  paintBox(context, camera, row, moment) {
    const box = this.scene.place(row, moment, this.there);
    if (!box.isThere) return;
    const { corner, length } = boxPath(context, camera, box);
    context.fillStyle = this.color[row];
    context.fill();
    const isSelected = row === this.selected;
    context.strokeStyle = isSelected ? this.style.ink : this.style.white;
    context.lineWidth = (isSelected ? 1.6 : 0.8) / camera.scale;
    context.stroke();
    if (length > 1.2 && length * camera.scale > 7) {
      polygon(context, [corner(0.42, 0), corner(0.15, 0.34), corner(0.15, -0.34)]);
      context.fillStyle = this.style.white;
      context.globalAlpha = 0.75;
      context.fill();
      context.globalAlpha = 1;
    }
  }

  paintLights(context, camera, step) {
    const { scene } = this;
    const side = Math.min(Math.max(1.6, 5 / camera.scale), 12 / camera.scale) / 2;
    for (let light = 0; light < scene.lights.length; light++) {
      const [x, y] = scene.lightPosition.subarray(2 * light, 2 * light + 2);
      if (Number.isNaN(x)) continue;
      const name = scene.lightColors[scene.lightState[light * scene.numSteps + step]];
      const { fill, shape } = this.style.lights[name];
      mark(context, x, y, side, shape);
      context.fillStyle = fill;
      context.fill();
      context.strokeStyle = this.style.ink;
      context.lineWidth = 0.8 / camera.scale;
      context.stroke();
    }
  }

  paintNames(context, camera, ratio, moment) {
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.font = "11px system-ui, sans-serif";
    context.lineWidth = 3;
    context.strokeStyle = this.style.white;
    context.fillStyle = this.style.ink;
    for (const row of this.order) {
      const box = this.scene.place(row, moment, this.there);
      if (!box.isThere) continue;
      const px = camera.width / 2 + (box.x - camera.x) * camera.scale + 6;
      const py = camera.height / 2 - (box.y - camera.y) * camera.scale - 6;
      if (px < 0 || py < 0 || px > camera.width || py > camera.height) continue;
      const name = this.scene.names[row];
      context.strokeText(name, px, py);
      context.fillText(name, px, py);
    }
  }

  // Return the topmost object at a point [m] within a tolerance [m]; -1 for none.
  hit(x, y, slack, moment) {
    for (let place = this.order.length - 1; place >= 0; place--) {
      const box = this.scene.place(this.order[place], moment, this.there);
      if (!box.isThere) continue;
      const dx = x - box.x;
      const dy = y - box.y;
      const ahead = Math.abs(dx * Math.cos(box.heading) + dy * Math.sin(box.heading));
      const beside = Math.abs(dy * Math.cos(box.heading) - dx * Math.sin(box.heading));
      if (ahead <= Math.max(box.length, least) / 2 + slack && beside <= Math.max(box.width, least) / 2 + slack) return this.order[place];
    }
    return -1;
  }
}

// Trace a box that is large enough to be seen; returns its length, and the place of a corner in shares of its sides.
export function boxPath(context, camera, box) {
  const length = Math.max(box.length, least, 3 / camera.scale);
  const width = Math.max(box.width, least, 3 / camera.scale);
  const cos = Math.cos(box.heading);
  const sin = Math.sin(box.heading);
  const corner = (ahead, left) => [box.x + ahead * length * cos - left * width * sin, box.y + ahead * length * sin + left * width * cos];
  polygon(context, [corner(0.5, 0.5), corner(-0.5, 0.5), corner(-0.5, -0.5), corner(0.5, -0.5)]);
  return { corner, length };
}

function polygon(context, points) {
  context.beginPath();
  points.forEach(([x, y], place) => context[place ? "lineTo" : "moveTo"](x, y));
  context.closePath();
}

// Draw a marker by its matplotlib name: s square, ^ triangle, D diamond, o circle.
function mark(context, x, y, radius, shape) {
  const corners = shapes[shape];
  context.beginPath();
  if (!corners) return context.arc(x, y, radius, 0, 2 * Math.PI);
  const start = shape === "s" ? Math.PI / 4 : Math.PI / 2;
  const reach = shape === "s" ? radius * Math.SQRT2 * 0.9 : radius * 1.2;
  for (let k = 0; k < corners; k++) {
    const angle = start + (2 * Math.PI * k) / corners;
    context[k ? "lineTo" : "moveTo"](x + reach * Math.cos(angle), y + reach * Math.sin(angle));
  }
  context.closePath();
}
