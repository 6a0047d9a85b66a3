// A camera that looks at a point on the ground from around it. Metres and radians; x east, y north, z up.

const fieldOfView = Math.PI / 4;
const [closest, farthest] = [6, 1500]; // [m] from the point
const [lowest, highest] = [0.06, Math.PI / 2 - 0.01]; // elevation

export class Orbit {
  constructor() {
    this.x = this.y = 0; // the point
    this.distance = 60;
    this.azimuth = -Math.PI / 2; // where the camera is, seen from the point
    this.elevation = 0.6;
    this.width = this.height = 1; // of the canvas, in CSS pixels
  }

  // Show a box [min x, min y, max x, max y].
  fit(box, margin = 20) {
    if (!Number.isFinite(box[0])) return;
    this.x = (box[0] + box[2]) / 2;
    this.y = (box[1] + box[3]) / 2;
    const radius = Math.hypot(box[2] - box[0], box[3] - box[1]) / 2 + margin;
    this.distance = clamp(radius / Math.tan(fieldOfView / 2) / Math.min(1, this.width / this.height), closest, farthest);
  }

  zoom(factor) {
    this.distance = clamp(this.distance / factor, closest, farthest);
  }

  turn(dx, dy) {
    this.azimuth -= 0.006 * dx;
    this.elevation = clamp(this.elevation + 0.006 * dy, lowest, highest);
  }

  // Move the point with the pointer, as if the ground were dragged [pixel].
  pan(dx, dy) {
    const scale = (2 * this.distance * Math.tan(fieldOfView / 2)) / this.height;
    const [cos, sin] = [Math.cos(this.azimuth), Math.sin(this.azimuth)];
    const ahead = (scale * dy) / Math.max(0.3, Math.sin(this.elevation));
    this.x += scale * dx * sin - ahead * cos;
    this.y -= scale * dx * cos + ahead * sin;
  }

  // Eye and the directions right, up and ahead.
  get frame() {
    const [cos, sin] = [Math.cos(this.azimuth), Math.sin(this.azimuth)];
    const [level, rise] = [Math.cos(this.elevation), Math.sin(this.elevation)];
    return {
      eye: [this.x + this.distance * level * cos, this.y + this.distance * level * sin, this.distance * rise],
      right: [-sin, cos, 0],
      up: [-rise * cos, -rise * sin, level],
      ahead: [-level * cos, -level * sin, -rise],
    };
  }

  // From metres to clip space, in columns as WebGL expects them.
  matrix() {
    const { eye, right, up, ahead } = this.frame;
    const near = Math.max(0.3, this.distance / 100);
    const far = 4 * farthest;
    const tall = 1 / Math.tan(fieldOfView / 2);
    const wide = (tall * this.height) / this.width;
    const depth = (far + near) / (far - near);
    const found = new Float32Array(16);
    for (let k = 0; k < 3; k++) {
      found[4 * k] = wide * right[k];
      found[4 * k + 1] = tall * up[k];
      found[4 * k + 2] = depth * ahead[k];
      found[4 * k + 3] = ahead[k];
    }
    found[12] = -wide * dot(right, eye);
    found[13] = -tall * dot(up, eye);
    found[14] = -depth * dot(ahead, eye) - (2 * far * near) / (far - near);
    found[15] = -dot(ahead, eye);
    return found;
  }

  // The ray from the eye through a pixel.
  ray(px, py) {
    const { eye, right, up, ahead } = this.frame;
    const half = Math.tan(fieldOfView / 2);
    const x = ((2 * px) / this.width - 1) * half * (this.width / this.height);
    const y = (1 - (2 * py) / this.height) * half;
    return { eye, direction: ahead.map((value, k) => value + x * right[k] + y * up[k]) };
  }
}

function dot(a, b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

function clamp(value, least, most) {
  return Math.min(most, Math.max(least, value));
}
