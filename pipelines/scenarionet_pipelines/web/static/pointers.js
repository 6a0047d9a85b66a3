// Pointers on a canvas as gestures: dragging with one, pinching with two, the wheel, hovering and picking.

const still = 4; // [pixel] a press that moves less is a pick

export class Pointers {
  // `on` has drag(dx, dy, event), zoom(factor, x, y), hover(place or null) and pick(place); places in pixels.
  constructor(canvas, on) {
    Object.assign(this, { canvas, on });
    this.down = new Map(); // places by pointer
    this.dragged = 0;
    canvas.addEventListener("wheel", (event) => this.onWheel(event), { passive: false });
    canvas.addEventListener("pointerdown", (event) => this.onDown(event));
    canvas.addEventListener("pointermove", (event) => this.onPointer(event));
    for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, (event) => this.onUp(event));
    canvas.addEventListener("pointerleave", () => on.hover(null));
  }

  onWheel(event) {
    event.preventDefault();
    const pixels = event.deltaY * [1, 16, 400][event.deltaMode];
    this.on.zoom(Math.exp(-pixels / 500), event.offsetX, event.offsetY);
  }

  onDown(event) {
    this.canvas.setPointerCapture(event.pointerId);
    this.down.set(event.pointerId, [event.offsetX, event.offsetY]);
    this.dragged = 0;
  }

  onPointer(event) {
    const before = this.down.get(event.pointerId);
    const here = [event.offsetX, event.offsetY];
    if (!before) return this.on.hover(event.pointerType === "touch" ? null : here);
    if (this.down.size === 2) this.pinch(event, before, here);
    else this.drag(event, before, here);
    this.down.set(event.pointerId, here);
  }

  drag(event, before, here) {
    this.dragged += Math.hypot(here[0] - before[0], here[1] - before[1]);
    if (this.dragged > still) this.on.drag(here[0] - before[0], here[1] - before[1], event);
  }

  pinch(event, before, here) {
    const [other] = [...this.down].filter(([each]) => each !== event.pointerId).map(([, place]) => place);
    const distance = (place) => Math.hypot(place[0] - other[0], place[1] - other[1]) || 1;
    this.dragged = Infinity;
    this.on.zoom(distance(here) / distance(before), (here[0] + other[0]) / 2, (here[1] + other[1]) / 2);
    this.on.drag((here[0] - before[0]) / 2, (here[1] - before[1]) / 2, event);
  }

  onUp(event) {
    this.down.delete(event.pointerId);
    if (event.type === "pointerup" && this.dragged <= still) this.on.pick([event.offsetX, event.offsetY]);
  }
}
