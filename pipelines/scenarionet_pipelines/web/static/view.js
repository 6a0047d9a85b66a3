// What the player's two views have in common: a canvas, a camera, what is followed, and what the pointer is over.

import { MapHit } from "/static/map_hit.js";

const layerOf = { lane: "roads", area: "roads", line: "lines", stop: "lines", edge: "edges", crosswalk: "crosswalks" };

export class View {
  constructor(canvas, scene, style, layers, clock, camera) {
    Object.assign(this, { canvas, scene, style, layers, clock, camera });
    this.hits = new MapHit(scene);
    this.follows = false;
    this.isStale = true;
    this.movedAt = -Infinity;
    this.pointer = null;
    this.onHover = () => {};
    this.onPick = () => {};
    this.onMove = () => {};
  }

  resize() {
    const { width, height } = this.canvas.getBoundingClientRect();
    this.ratio = Math.min(devicePixelRatio || 1, 2);
    this.canvas.width = Math.max(1, Math.round(width * this.ratio));
    this.canvas.height = Math.max(1, Math.round(height * this.ratio));
    this.camera.width = Math.max(1, width);
    this.camera.height = Math.max(1, height);
    this.isStale = true;
  }

  fitRoute() {
    this.camera.fit(this.scene.route());
    this.moved();
  }

  fitAll() {
    this.camera.fit(this.scene.bounds());
    this.moved();
  }

  moved() {
    this.movedAt = performance.now();
    this.isStale = true;
    this.onMove();
  }

  redrawMap() {
    this.isStale = true;
  }

  // Put the camera over the selected object or the ego.
  center(moment) {
    const followed = this.objects.selected >= 0 ? this.objects.selected : this.scene.ego;
    const place = this.scene.place(followed, moment, {});
    if (place.isThere) [this.camera.x, this.camera.y] = [place.x, place.y];
  }

  // Row of the visible map feature at a point [m]; -1 for none.
  featureAt(x, y, slack) {
    return this.hits.at(x, y, slack, (kind) => this.layers[layerOf[kind]]);
  }

  // Update the tooltip for a pointer position; null hides it.
  hover(here = this.pointer) {
    this.pointer = here;
    this.onHover(here && { ...this.under(here), place: here });
  }
}
