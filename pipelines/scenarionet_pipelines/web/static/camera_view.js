// What a camera of the simulator sees from an object, drawn by the server: a picture in the picture, or in its place.

import { fill, make } from "/static/elements.js";
import { getBytes } from "/static/server.js";

const perSecond = 10; // timesteps of the simulator
const labels = { chase: "From behind", camera: "Its own camera" };

export class CameraView {
  // `onChange` is called when the user chooses another view.
  constructor(lake, scene, runs, onChange) {
    Object.assign(this, { lake, scene, runs, onChange });
    this.view = ""; // none
    this.isLarge = false;
    this.canvas = make("canvas", { role: "img" });
    this.said = make("p", { role: "status" });
    this.title = make("span");
    this.views = make("select", { "aria-label": "Camera" }, ...lake.cameras.views.map((name) => make("option", { value: name }, labels[name])));
    this.views.addEventListener("change", () => this.choose(this.views.value));
    this.larger = make("button", { type: "button", class: "larger", "aria-label": "Larger", "aria-pressed": "false", onclick: () => this.enlarge() }, "⤢");
    const close = make("button", { type: "button", "aria-label": "Close the camera", onclick: () => this.choose("") }, "×");
    this.inside = [this.canvas, this.said, make("figcaption", {}, this.title, this.views, this.larger, close)];
    this.element = make("figure", { class: "seen", hidden: true });
  }

  choose(view) {
    this.view = this.lake.cameras.views.includes(view) ? view : "";
    this.element.hidden = !this.view;
    fill(this.element, ...(this.view ? this.inside : []));
    this.views.value = this.view || this.lake.cameras.views[0];
    this.onChange();
  }

  enlarge() {
    this.isLarge = !this.isLarge;
    this.element.classList.toggle("large", this.isLarge);
    this.larger.setAttribute("aria-pressed", String(this.isLarge));
    this.onChange();
  }

  // Ask for the picture of an object and a time, unless an earlier one is still under way; called for every frame.
  show(row, time) {
    if (!this.view || this.isAsking) return;
    const run = this.runs.shown[0];
    const step = Math.round(time * perSecond);
    const motion = run ?? this.scene;
    const isThere = time >= motion.time[0] - 1e-3 && time <= motion.duration + 1e-3 && motion.isThere(row, motion.at(time).step);
    const asked = { id: this.scene.id, snapshot: this.lake.snapshot, object: this.scene.objects[row].id, view: this.view, step, run: run?.key ?? "", width: this.lake.cameras.widths[Number(this.isLarge)] };
    const key = JSON.stringify(asked);
    if (key === this.shown) return;
    this.shown = key;
    this.title.textContent = `${this.scene.names[row]}${run ? `, ${run.key}` : ""}`;
    if (isThere) this.ask(asked);
    else this.say("not visible now");
  }

  async ask(asked) {
    this.isAsking = true;
    const patience = setTimeout(() => this.say("Drawing… The first picture takes up to a minute."), 1500);
    try {
      const picture = await createImageBitmap(new Blob([await getBytes("/api/camera", asked)]));
      [this.canvas.width, this.canvas.height] = [picture.width, picture.height];
      this.canvas.getContext("2d").drawImage(picture, 0, 0);
      this.canvas.setAttribute("aria-label", `${labels[asked.view]}: ${this.title.textContent} at ${(asked.step / perSecond).toFixed(1)} s`);
      this.say("");
    } catch (error) {
      this.say(error.message);
    } finally {
      clearTimeout(patience);
      this.isAsking = false;
    }
  }

  say(text) {
    this.said.textContent = text;
    this.canvas.classList.toggle("stale", Boolean(text));
  }
}
