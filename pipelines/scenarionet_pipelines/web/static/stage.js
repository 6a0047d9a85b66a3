// The canvas of the player: paints a scene at a time and moves the camera with pointer and wheel.

import { Camera } from "/static/camera.js";
import { MapLayer } from "/static/map_layer.js";
import { ObjectLayer } from "/static/object_layer.js";
import { Pointers } from "/static/pointers.js";
import { RunLayer } from "/static/run_layer.js";
import { View } from "/static/view.js";

const rest = 150; // [ms] without movement after which the camera counts as resting
const bars = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000]; // [m]

export class Stage extends View {
  constructor(canvas, scene, style, layers, clock, runs) {
    super(canvas, scene, style, layers, clock, new Camera());
    this.context = canvas.getContext("2d", { alpha: false });
    this.map = new MapLayer(scene, style, layers);
    this.objects = new ObjectLayer(scene, style, layers);
    this.runLayer = new RunLayer(scene, runs);
    this.listen();
    this.resize();
    this.fitRoute();
  }

  redrawMap() {
    this.map.forget();
    super.redrawMap();
  }

  // Paint if something has changed.
  paint(now, isForced) {
    if (!this.isStale && !isForced) return;
    this.isStale = false;
    const moment = this.scene.at(this.clock.time);
    if (this.follows) this.center(moment);
    const isMoving = now - this.movedAt < rest;
    if (this.map.paint(this.context, this.camera, this.ratio, isMoving)) this.isStale = true;
    this.objects.paint(this.context, this.camera, this.ratio, moment);
    this.runLayer.paint(this.context, this.camera, this.ratio, this.clock.time);
    this.paintBar();
  }

  // Follow the selected object or the ego, or stop.
  follow(isFollowed) {
    this.follows = isFollowed;
    if (isFollowed) this.camera.scale = Math.max(this.camera.scale, this.camera.width / 160);
    this.moved();
  }

  // A canvas has nothing to release.
  close() {}

  // Scale bar of a round length.
  paintBar() {
    const { context, camera, ratio, style } = this;
    const length = bars.findLast((bar) => bar * camera.scale <= camera.width * 0.22) ?? bars[0];
    const width = length * camera.scale;
    const y = camera.height - 14;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    for (const [color, thickness] of [[style.white, 5], [style.ink, 2]]) {
      context.strokeStyle = color;
      context.lineWidth = thickness;
      context.beginPath();
      context.moveTo(14, y);
      context.lineTo(14 + width, y);
      context.stroke();
    }
    context.font = "12px system-ui, sans-serif";
    context.lineWidth = 3;
    context.strokeStyle = style.white;
    context.fillStyle = style.ink;
    context.strokeText(`${length} m`, 14, y - 6);
    context.fillText(`${length} m`, 14, y - 6);
  }

  // --- pointers ----------------------------------------------------------------------------------

  listen() {
    this.canvas.addEventListener("dblclick", () => this.fitRoute());
    this.pointers = new Pointers(this.canvas, {
      drag: (dx, dy) => { this.follows = false; this.camera.pan(dx, dy); this.moved(); },
      zoom: (factor, x, y) => { this.camera.zoom(factor, x, y); this.moved(); },
      hover: (place) => this.hover(place),
      pick: (place) => this.onPick(this.under(place).object),
    });
  }

  // Object and map feature at a canvas position, as rows; -1 for none.
  under([px, py]) {
    const [x, y] = this.camera.toWorld(px, py);
    const slack = 4 / this.camera.scale;
    const object = this.layers.objects ? this.objects.hit(x, y, slack, this.scene.at(this.clock.time)) : -1;
    const feature = object < 0 ? this.featureAt(x, y, slack) : -1;
    return { object, feature, at: [x, y] };
  }
}
