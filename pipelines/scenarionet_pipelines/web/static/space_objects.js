// Objects, runs and traffic lights as instances of shapes, and which of them a ray hits.

import { bytes } from "/static/space_ground.js";
import { numInstance } from "/static/webgl.js";

const least = 0.5; // minimum side of a drawn object [m]
const heights = { VEHICLE: 1.6, PEDESTRIAN: 1.7, CYCLIST: 1.7 }; // [m] where none is recorded
const longest = 7; // [m] longer vehicles are drawn as boxes: buses and lorries

// Values of the instances of one shape; they grow as needed and are kept between frames.
class Instances {
  constructor() {
    this.values = new Float32Array(64 * numInstance);
    this.count = 0;
  }

  add(x, y, z, cos, sin, length, width, height, color, alpha) {
    const at = this.count * numInstance;
    if (at === this.values.length) {
      const larger = new Float32Array(2 * at);
      larger.set(this.values);
      this.values = larger;
    }
    const { values } = this;
    values[at] = x; values[at + 1] = y; values[at + 2] = z;
    values[at + 3] = cos; values[at + 4] = sin;
    values[at + 5] = length; values[at + 6] = width; values[at + 7] = height;
    values[at + 8] = color[0]; values[at + 9] = color[1]; values[at + 10] = color[2]; values[at + 11] = alpha;
    this.count++;
  }
}

export class SpaceObjects {
  constructor(scene, style, runs) {
    Object.assign(this, { scene, style, runs });
    this.selected = -1;
    this.there = {};
    this.colors = scene.objects.map((object, row) => shares(row === scene.ego ? style.ego : style.objects[object.type]));
    this.height = scene.objects.map(({ type }, row) => scene.size[3 * row + 2] || heights[type] || 1);
    this.shape = scene.objects.map(({ type }, row) => (type === "VEHICLE" ? (scene.size[3 * row] > longest ? "box" : "car") : type === "PEDESTRIAN" || type === "CYCLIST" ? "pillar" : "box"));
    this.lights = Object.fromEntries(Object.entries(style.lights).map(([name, { fill }]) => [name, shares(fill)]));
    this.dark = shares("#2a2f36");
    this.ring = shares(style.ego);
    this.solid = { car: new Instances(), box: new Instances(), pillar: new Instances() };
    this.shadows = new Instances();
  }

  // Fill the instances with what is there at a time.
  update(layers, moment, time) {
    for (const instances of [...Object.values(this.solid), this.shadows]) instances.count = 0;
    if (layers.objects) for (let row = 0; row < this.scene.numObjects; row++) this.object(this.scene, row, moment, this.colors[row], 1);
    for (const run of this.runs.shown) {
      if (time < run.time[0] - 1e-3) continue;
      run.shares ??= shares(run.color);
      const now = run.at(time);
      for (const row of run.driven) this.object(run, row, now, run.shares, 1);
    }
    if (layers.lights) this.trafficLights(moment.step);
  }

  object(motion, row, moment, color, alpha) {
    const box = motion.place(row, moment, this.there);
    if (!box.isThere) return;
    const [cos, sin] = [Math.cos(box.heading), Math.sin(box.heading)];
    const [length, width] = [Math.max(box.length, least), Math.max(box.width, least)];
    this.solid[this.shape[row]].add(box.x, box.y, 0, cos, sin, length, width, this.height[row], color, alpha);
    this.shadows.add(box.x, box.y, 0, cos, sin, length + 0.5, width + 0.5, 1, this.dark, 0.35);
    if (row === this.selected && motion === this.scene) this.shadows.add(box.x, box.y, 0, cos, sin, length + 1.6, width + 1.6, 1, this.ring, 0.55);
  }

  trafficLights(step) {
    const { scene } = this;
    for (let light = 0; light < scene.lights.length; light++) {
      const [x, y] = [scene.lightPosition[2 * light], scene.lightPosition[2 * light + 1]];
      if (Number.isNaN(x)) continue;
      const color = this.lights[scene.lightColors[scene.lightState[light * scene.numSteps + step]]];
      this.solid.box.add(x, y, 0, 1, 0, 0.12, 0.12, 3, this.dark, 1);
      this.solid.pillar.add(x, y, 3, 1, 0, 0.9, 0.9, 0.9, color, 1);
    }
  }

  // The nearest object that a ray hits; -1 for none.
  hit({ eye, direction }, moment) {
    let [found, nearest] = [-1, Infinity];
    for (let row = 0; row < this.scene.numObjects; row++) {
      const box = this.scene.place(row, moment, this.there);
      if (!box.isThere) continue;
      const [cos, sin] = [Math.cos(box.heading), Math.sin(box.heading)];
      const local = (x, y) => [cos * x + sin * y, cos * y - sin * x];
      const from = [...local(eye[0] - box.x, eye[1] - box.y), eye[2] - this.height[row] / 2];
      const along = [...local(direction[0], direction[1]), direction[2]];
      const sides = [Math.max(box.length, least), Math.max(box.width, least), this.height[row]];
      let [enters, leaves] = [0, Infinity];
      for (let k = 0; k < 3; k++) {
        const [first, second] = [(-sides[k] / 2 - from[k]) / along[k], (sides[k] / 2 - from[k]) / along[k]];
        enters = Math.max(enters, Math.min(first, second));
        leaves = Math.min(leaves, Math.max(first, second));
      }
      if (enters <= leaves && enters < nearest) [found, nearest] = [row, enters];
    }
    return found;
  }
}

function shares(color) {
  return bytes(color).map((value) => value / 255);
}
