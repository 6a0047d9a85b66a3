// Runs over the recording: the paths of the evaluated vehicles, and boxes of everything that a run drives.

import { boxPath } from "/static/object_layer.js";

const dashes = [[], [6, 3], [2, 2]]; // [pixel] paths of the first, second and third run

export class RunLayer {
  constructor(scene, runs) {
    Object.assign(this, { scene, runs });
    this.there = {};
    this.paths = new Map(); // by run
  }

  paint(context, camera, ratio, time) {
    camera.apply(context, ratio);
    this.runs.shown.forEach((run, place) => {
      context.strokeStyle = context.fillStyle = run.color;
      context.lineWidth = 2 / camera.scale;
      context.setLineDash(dashes[place].map((length) => length / camera.scale));
      context.globalAlpha = 0.85;
      context.stroke(this.path(run));
      context.setLineDash([]);
      this.paintBoxes(context, camera, run, time);
      context.globalAlpha = 1;
    });
  }

  paintBoxes(context, camera, run, time) {
    if (time < run.time[0] - 1e-3) return;
    const moment = run.at(time);
    for (const row of run.driven) {
      const box = run.place(row, moment, this.there);
      if (!box.isThere) continue;
      boxPath(context, camera, box);
      context.globalAlpha = run.judged.includes(row) ? 0.75 : 0.2;
      context.fill();
      context.globalAlpha = 1;
      context.lineWidth = 1.8 / camera.scale;
      context.stroke();
    }
  }

  // Path of the evaluated vehicles.
  path(run) {
    if (!this.paths.has(run)) {
      const path = new Path2D();
      for (const row of run.judged) {
        let isDrawing = false;
        for (let step = 0; step < run.numSteps; step++) {
          const at = row * run.numSteps + step;
          if (run.valid[at]) path[isDrawing ? "lineTo" : "moveTo"](run.position[2 * at], run.position[2 * at + 1]);
          isDrawing = run.valid[at] === 1;
        }
      }
      this.paths.set(run, path);
    }
    return this.paths.get(run);
  }
}
