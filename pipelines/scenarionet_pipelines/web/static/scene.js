// A scenario in the binary format of pipelines/scenarionet_pipelines/web/packing.py.

const kinds = { float32: Float32Array, float64: Float64Array, int32: Int32Array, uint8: Uint8Array };

export function unpack(buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  const arrays = {};
  for (const [name, { type, shape, offset }] of Object.entries(header.arrays)) {
    const size = shape.reduce((a, b) => a * b, 1);
    arrays[name] = new kinds[type](buffer, 4 + length + offset, size);
  }
  return new Scene(header, arrays);
}

// One scenario with N objects and T timesteps, in metres, radians and seconds.
class Scene {
  constructor(header, arrays) {
    Object.assign(this, header, arrays);
    this.numSteps = this.time.length;
    this.duration = this.time[this.numSteps - 1];
    this.numObjects = this.objects.length;
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

function extend(box, x, y) {
  box[0] = Math.min(box[0], x);
  box[1] = Math.min(box[1], y);
  box[2] = Math.max(box[2], x);
  box[3] = Math.max(box[3], y);
}

function turn(angle) {
  return angle - 2 * Math.PI * Math.round(angle / (2 * Math.PI));
}
