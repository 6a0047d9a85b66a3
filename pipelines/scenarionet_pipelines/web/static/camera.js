// The part of the world that a canvas shows: its centre [m] and its scale [pixel/m]. North is up.

const closest = 60;
const farthest = 0.02;

export class Camera {
  constructor() {
    this.x = this.y = 0;
    this.scale = 5;
    this.width = this.height = 1; // of the canvas, in CSS pixels
  }

  // Show a box [min x, min y, max x, max y] with a margin [m].
  fit(box, margin = 25) {
    if (!Number.isFinite(box[0])) return;
    this.x = (box[0] + box[2]) / 2;
    this.y = (box[1] + box[3]) / 2;
    const across = box[2] - box[0] + 2 * margin;
    const down = box[3] - box[1] + 2 * margin;
    this.scale = clamp(Math.min(this.width / across, this.height / down));
  }

  // Zoom by a factor around the point (px, py).
  zoom(factor, px = this.width / 2, py = this.height / 2) {
    const [x, y] = this.toWorld(px, py);
    this.scale = clamp(this.scale * factor);
    const [movedX, movedY] = this.toWorld(px, py);
    this.x += x - movedX;
    this.y += y - movedY;
  }

  pan(dx, dy) {
    this.x -= dx / this.scale;
    this.y += dy / this.scale;
  }

  toWorld(px, py) {
    return [this.x + (px - this.width / 2) / this.scale, this.y - (py - this.height / 2) / this.scale];
  }

  // Set the transform of a context so that it draws in metres.
  apply(context, ratio) {
    const s = this.scale * ratio;
    context.setTransform(s, 0, 0, -s, (ratio * this.width) / 2 - s * this.x, (ratio * this.height) / 2 + s * this.y);
  }
}

function clamp(scale) {
  return Math.min(closest, Math.max(farthest, scale));
}
