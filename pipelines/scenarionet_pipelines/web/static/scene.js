// A scenario, and runs of it, in the binary format of pipelines/scenarionet_pipelines/web/packing.py.

import { words } from "/static/format.js";

const kinds = { float32: Float32Array, float64: Float64Array, int32: Int32Array, uint8: Uint8Array };
const reach = 0.25; // [s] accelerations are differences of the speed over twice this time

// Read the header and the arrays.
function read(buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  const arrays = {};
  const { arrays: described, ...facts } = header;
  for (const [name, { type, shape, offset }] of Object.entries(described)) {
    const size = shape.reduce((a, b) => a * b, 1);
    arrays[name] = new kinds[type](buffer, 4 + length + offset, size);
  }
  return { ...facts, ...arrays };
}

export function unpack(buffer) {
  return new Scene(read(buffer));
}

// A rollout of a scene in one of the colours of runs; `key` names it in addresses.
export function unpackRun(buffer, scene, key, color) {
  return new Run({ ...read(buffer), size: scene.size, key, color });
}

// Motion of N objects at T times, in metres, radians and seconds.
class Motion {
  constructor(content) {
    Object.assign(this, content);
    this.numSteps = this.time.length;
    this.duration = this.time[this.numSteps - 1];
  }

  // The last timestep not after a time, and the fraction of the way to the next one.
  at(time) {
    let step = 0;
    let end = this.numSteps - 1;
    while (step < end) {
      const middle = (step + end + 1) >> 1;
      if (this.time[middle] <= time + 1e-6) step = middle;
      else end = middle - 1;
    }
    if (step === this.numSteps - 1) return { step, part: 0 };
    return { step, part: Math.max(0, (time - this.time[step]) / (this.time[step + 1] - this.time[step])) };
  }

  isThere(object, step) {
    return this.valid[object * this.numSteps + step] === 1;
  }

  // Pose of an object, interpolated linearly between timesteps if it is valid at both.
  place(object, { step, part }, into) {
    const row = object * this.numSteps + step;
    into.isThere = this.valid[row] === 1;
    if (!into.isThere) return into;
    into.x = this.position[2 * row];
    into.y = this.position[2 * row + 1];
    into.heading = this.heading[row];
    into.length = this.size[3 * object];
    into.width = this.size[3 * object + 1];
    into.height = this.size[3 * object + 2];
    if (part > 0 && this.valid[row + 1] === 1) {
      into.x += part * (this.position[2 * row + 2] - into.x);
      into.y += part * (this.position[2 * row + 3] - into.y);
      into.heading += part * turn(this.heading[row + 1] - into.heading);
    }
    return into;
  }

  speed(object, step) {
    const row = 2 * (object * this.numSteps + step);
    return Math.hypot(this.velocity[row], this.velocity[row + 1]);
  }

  // Speed along the heading of an object at every time [m/s]; NaN where it is absent.
  speeds(object) {
    return Float32Array.from(this.time, (_, step) => {
      const row = object * this.numSteps + step;
      if (!this.valid[row]) return NaN;
      return this.velocity[2 * row] * Math.cos(this.heading[row]) + this.velocity[2 * row + 1] * Math.sin(this.heading[row]);
    });
  }

  // Acceleration along the heading at every time [m/s²], over half a second; NaN where it is unknown.
  accelerations(object) {
    const { time } = this;
    const speed = this.speeds(object);
    const isNear = (step, other) => isKnown(speed[other]) && Math.abs(time[other] - time[step]) <= reach + 1e-3;
    return speed.map((_, step) => {
      let [first, last] = [step, step];
      while (first > 0 && (isNear(step, first - 1) || (first === step && isKnown(speed[step - 1])))) first--;
      while (last < time.length - 1 && (isNear(step, last + 1) || (last === step && isKnown(speed[step + 1])))) last++;
      return last > first && isKnown(speed[step]) ? (speed[last] - speed[first]) / (time[last] - time[first]) : NaN;
    });
  }
}

// The recording.
class Scene extends Motion {
  constructor(content) {
    super(content);
    this.numObjects = this.objects.length;
    const counts = {};
    this.names = this.objects.map(({ type }, row) => {
      if (row === this.ego) return "ego";
      counts[type] = (counts[type] ?? 0) + 1;
      return `${words(type)} ${counts[type]}`;
    });
  }

  // First and last valid timestep of an object.
  span(object) {
    const start = object * this.numSteps;
    const row = this.valid.subarray(start, start + this.numSteps);
    return [row.indexOf(1), row.lastIndexOf(1)];
  }

  // Bounding box of the scenario: [min x, min y, max x, max y].
  bounds() {
    const box = [Infinity, Infinity, -Infinity, -Infinity];
    for (let row = 0; row < this.valid.length; row++) {
      if (this.valid[row]) extend(box, this.position[2 * row], this.position[2 * row + 1]);
    }
    return box;
  }

  // Bounding box of the ego's trajectory.
  route() {
    const box = [Infinity, Infinity, -Infinity, -Infinity];
    for (let step = 0; step < this.numSteps; step++) {
      const row = this.ego * this.numSteps + step;
      if (this.valid[row]) extend(box, this.position[2 * row], this.position[2 * row + 1]);
    }
    return box;
  }
}

// A rollout: `judged` are the rows of the evaluated vehicles, `driven` of all that move otherwise than recorded.
class Run extends Motion {}

function isKnown(value) {
  return !Number.isNaN(value);
}

function extend(box, x, y) {
  box[0] = Math.min(box[0], x);
  box[1] = Math.min(box[1], y);
  box[2] = Math.max(box[2], x);
  box[3] = Math.max(box[3], y);
}

function turn(angle) {
  return angle - 2 * Math.PI * Math.round(angle / (2 * Math.PI));
}
