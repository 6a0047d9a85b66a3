// The player: one scenario on a canvas, with controls, layers and properties.

import * as address from "/static/address.js";
import { CameraView } from "/static/camera_view.js";
import { Clock } from "/static/clock.js";
import { askClip } from "/static/clip.js";
import { controls } from "/static/controls.js";
import { find, make, fill } from "/static/elements.js";
import { described, featureFacts, objectFacts, scenarioFacts } from "/static/facts.js";
import { plural } from "/static/format.js";
import { press } from "/static/keyboard.js";
import { moreLike } from "/static/like.js";
import { Legend } from "/static/legend.js";
import { Runs } from "/static/runs.js";
import { unpack } from "/static/scene.js";
import { getBytes, getJson } from "/static/server.js";
import { beside } from "/static/table.js";
import { Stage } from "/static/stage.js";
import { hasSpace, Space } from "/static/space.js";
import { Timeline } from "/static/timeline.js";

const layers = { roads: true, direction: true, lines: true, edges: true, crosswalks: true, route: true, trails: true, objects: true, lights: true, names: false };
let playing = null;

export function closePlayer() {
  playing?.close();
  playing = null;
  fill(find("player"));
}

export async function openPlayer(lake, state, go) {
  closePlayer();
  const id = state.scenario;
  const bar = head(state);
  fill(find("player"), bar, make("p", { class: "nothing", role: "status" }, "Loading…"));
  let scene;
  let facts;
  try {
    const asked = { id, snapshot: lake.snapshot };
    const [bytes, row] = await Promise.all([getBytes("/api/scene", asked), getJson("/api/facts", { id })]);
    [scene, facts] = [unpack(bytes), row];
  } catch (error) {
    if (address.read().scenario === id) fill(find("player"), bar, make("p", { class: "problem", role: "alert" }, error.message));
    return;
  }
  if (address.read().scenario !== id) return; // another scenario was opened in the meantime
  playing = new Player(lake, scene, facts, bar, () => go({ ...address.elsewhere, scenario: "" }));
  playing.restore(state);
}

function head(state) {
  const links = make("span", { class: "beside" });
  const link = (rel, label, other) => {
    const target = () => address.href({ ...address.read(), ...address.elsewhere, ...other }); // with what was chosen meanwhile
    return other && make("a", { class: "button", rel, href: target(), onclick: (event) => { event.currentTarget.href = target(); } }, label);
  };
  const show = ([previous, next]) => fill(links, link("prev", "‹ Previous", previous), link("next", "Next ›", next));
  beside(state).then(show, () => {}); // without links if the filter of the address is wrong
  const back = address.href({ ...state, ...address.elsewhere, scenario: "" });
  return make("div", { class: "bar" }, make("a", { class: "button", href: back }, "‹ All scenarios"), make("h1", { class: "id" }, state.scenario), links);
}

class Player {
  constructor(lake, scene, facts, bar, onEnd) {
    Object.assign(this, { lake, scene, onEnd });
    this.clock = new Clock(scene.duration);
    this.clock.set(scene.time[scene.now]);
    this.style = matchMedia("(prefers-color-scheme: dark)").matches ? lake.darkPicture : lake.picture;
    this.tip = make("div", { class: "tip", "aria-hidden": "true", hidden: true });
    this.chosen = make("div", { class: "chosen", "aria-live": "off" });
    this.runs = new Runs(scene, this.style, () => this.runsChanged());
    this.camera = new CameraView(lake, scene, this.runs, () => { this.controls.update(); this.remember(); });
    this.controls = controls(this, layers, hasSpace());
    this.legend = new Legend(this.style, scene);
    this.timeline = new Timeline(scene, this.style, this.runs, (time) => this.seek(time), (row) => { this.pick(row); this.remember(); });
    this.picture = make("div", { class: "picture" }, this.tip, this.controls.view, this.legend.element);
    const side = make(
      "aside", { "aria-label": "Properties" },
      make("h2", {}, "Object"), this.chosen,
      make("details", { open: true }, make("summary", {}, "Runs"), this.runs.element),
      make("details", { open: true }, make("summary", {}, plural(scene.numObjects, "object")), this.objectList()),
      moreLike(lake, scene.id),
      make("details", {}, make("summary", {}, "Scenario"), scenarioFacts(lake, facts)),
    );
    const screen = make("div", { class: "screen" }, make("div", { class: "views" }, this.picture, this.camera.element), this.controls.bar, this.timeline.element);
    fill(find("player"), bar, make("div", { class: "stage" }, screen, side));
    this.sized = new ResizeObserver(() => this.stage.resize());
    this.look("");
    this.onKey = (event) => press(this, event);
    document.addEventListener("keydown", this.onKey);
    this.legend.show([]);
    this.pick(scene.ego);
    this.frame = requestAnimationFrame((now) => this.run(now));
    find("content").focus({ preventScroll: true }); // so that keyboard shortcuts work immediately
  }

  // Show the scene from above (""), or in space ("3d"), on a new canvas: one canvas cannot draw both.
  look(kind) {
    if (this.stage && this.isInSpace === (kind === "3d")) return;
    this.isInSpace = kind === "3d" && hasSpace();
    const before = this.stage;
    if (before) {
      this.sized.unobserve(before.canvas);
      before.close();
      before.canvas.remove();
    }
    const where = this.isInSpace ? "in space; dragging turns the view" : "from above";
    const canvas = make("canvas", { tabindex: "0", role: "img", "aria-label": `Scenario ${this.scene.id} ${where}; space plays, arrow keys step, plus and minus zoom` });
    this.picture.prepend(canvas);
    this.stage = new (this.isInSpace ? Space : Stage)(canvas, this.scene, this.style, layers, this.clock, this.runs);
    this.stage.onHover = (under) => this.showTip(under);
    this.stage.onPick = (row) => { this.pick(row); this.remember(); };
    this.stage.onMove = () => this.controls.update();
    this.sized.observe(canvas);
    this.tip.hidden = true;
    if (!before) return;
    this.stage.objects.selected = before.objects.selected;
    if (before.follows) this.stage.follow(true);
    this.controls.update();
    this.remember();
  }

  // Show the time, the object, the view and the runs of an address.
  restore({ at, object, follow, look, camera, runs }) {
    const row = this.scene.objects.findIndex(({ id }) => id === object);
    if (row >= 0) this.pick(row);
    this.wanted = { at: at !== "" && Number.isFinite(Number(at)) ? Number(at) : null, runs };
    if (this.wanted.at !== null) this.clock.set(this.wanted.at);
    if (look) this.look(look);
    if (camera) this.camera.choose(camera);
    if (follow) this.follow(true);
    this.changed();
    this.runs.load(runs.split(",").filter(Boolean));
  }

  // Called when the runs beside the recording are loaded or chosen.
  runsChanged() {
    this.clock.duration = Math.max(this.scene.duration, this.runs.duration);
    if (this.wanted.at > this.clock.time && !this.clock.isRunning) this.clock.set(this.wanted.at); // beyond the recording
    this.wanted = { at: null, runs: null };
    this.legend.show(this.runs.shown);
    this.timeline.show(this.stage.objects.selected);
    this.changed();
  }

  askClip() {
    askClip(this.lake, this.scene, this.runs);
  }

  // Keep the time and the object in the address, so that it can be shared.
  remember() {
    const { scene, clock, stage } = this;
    const isBegin = Math.abs(clock.time - scene.time[scene.now]) < 1e-3;
    const row = stage.objects.selected;
    address.replace({
      at: isBegin ? "" : clock.time.toFixed(2),
      object: row < 0 || row === scene.ego ? "" : scene.objects[row].id,
      follow: stage.follows ? "1" : "",
      look: this.isInSpace ? "3d" : "",
      camera: this.camera.view,
      runs: this.wanted?.runs ?? this.runs.keys.join(","),
    });
  }

  close() {
    cancelAnimationFrame(this.frame);
    this.sized.disconnect();
    this.timeline.close();
    this.stage.close();
    document.removeEventListener("keydown", this.onKey);
  }

  run(now) {
    const wasRunning = this.clock.isRunning;
    this.clock.tick(now);
    this.stage.paint(now, wasRunning);
    this.camera.show(this.row, this.clock.time);
    if (wasRunning) this.showTime();
    if (wasRunning && !this.clock.isRunning) this.remember();
    this.frame = requestAnimationFrame((next) => this.run(next));
  }

  showTime() {
    const { step } = this.scene.at(this.clock.time);
    this.controls.update();
    this.timeline.update(this.clock.time);
    if (step === this.shownStep) return;
    this.showChosen();
    this.stage.hover();
  }

  // Called after a change by the user.
  changed() {
    this.stage.isStale = true;
    this.showTime();
    if (!this.clock.isRunning) this.remember();
  }

  goTo(step) {
    this.clock.isRunning = false;
    this.clock.set(this.scene.time[Math.min(this.scene.numSteps - 1, Math.max(0, step))]);
    this.changed();
  }

  seek(time) {
    this.clock.isRunning = false;
    this.clock.set(time);
    this.changed();
  }

  toggle() {
    this.clock.toggle();
    this.changed();
  }

  toggleCamera() {
    this.camera.choose(this.camera.view ? "" : this.lake.cameras.views[0]);
  }

  follow(isFollowed) {
    this.stage.follow(isFollowed);
    this.remember();
  }

  // The selected object or the ego.
  get row() {
    return this.stage.objects.selected < 0 ? this.scene.ego : this.stage.objects.selected;
  }

  pick(row) {
    this.stage.objects.selected = row;
    for (const button of this.buttons.values()) button.removeAttribute("aria-current");
    this.buttons.get(row)?.setAttribute("aria-current", "true");
    this.showChosen();
    this.timeline.show(row);
    this.timeline.update(this.clock.time);
    this.stage.isStale = true;
  }

  showChosen() {
    const row = this.stage.objects.selected;
    this.shownStep = this.scene.at(this.clock.time).step;
    fill(this.chosen, ...(row < 0 ? [make("p", {}, "Select an object in the picture or in the list.")] : described(objectFacts(this.scene, row, this.shownStep))));
  }

  showTip(under) {
    const row = under?.object ?? -1;
    const feature = under?.feature ?? -1;
    this.tip.hidden = row < 0 && feature < 0;
    if (this.tip.hidden) return;
    const { step } = this.scene.at(this.clock.time);
    fill(this.tip, ...described(row >= 0 ? objectFacts(this.scene, row, step) : featureFacts(this.scene, feature)));
    const [x, y] = under.place;
    const { width, height } = this.stage.camera;
    const { offsetWidth, offsetHeight } = this.tip;
    this.tip.style.left = `${Math.max(4, x + 16 + offsetWidth > width ? x - 12 - offsetWidth : x + 16)}px`;
    this.tip.style.top = `${Math.max(4, Math.min(y + 12, height - offsetHeight - 4))}px`;
  }

  objectList() {
    const rows = [...this.scene.objects.keys()].sort((a, b) => (b === this.scene.ego) - (a === this.scene.ego));
    this.buttons = new Map();
    const items = rows.map((row) => {
      const button = make("button", { type: "button", onclick: () => { this.pick(row); this.remember(); } }, make("span", {}, this.scene.names[row]), make("small", {}, this.scene.objects[row].id));
      this.buttons.set(row, button);
      return make("li", {}, button);
    });
    return make("ul", { class: "objects" }, ...items);
  }
}
