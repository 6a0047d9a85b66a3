// The player: one scenario on a canvas, with controls, layers and properties.

import * as address from "/static/address.js";
import { Clock } from "/static/clock.js";
import { controls } from "/static/controls.js";
import { find, make, fill } from "/static/elements.js";
import { described, featureFacts, objectFacts, scenarioFacts } from "/static/facts.js";
import { plural, words } from "/static/format.js";
import { unpack } from "/static/scene.js";
import { getBytes, getJson } from "/static/server.js";
import { Stage } from "/static/stage.js";

const layers = { roads: true, direction: true, lines: true, edges: true, crosswalks: true, route: true, trails: true, objects: true, lights: true, names: false };
let playing = null;

export function closePlayer() {
  playing?.close();
  playing = null;
  fill(find("player"));
}

// Open a scenario; `listed` are the ids on the current page of the table.
export async function openPlayer(lake, state, listed, go) {
  closePlayer();
  const id = state.scenario;
  const back = address.href({ ...state, ...address.elsewhere, scenario: "" });
  fill(find("player"), head(state, id, back, listed), make("p", { class: "nothing", role: "status" }, "Loading…"));
  let scene;
  let facts;
  try {
    const asked = { id, snapshot: lake.snapshot };
    const [bytes, row] = await Promise.all([getBytes("/api/scene", asked), getJson("/api/facts", { id })]);
    [scene, facts] = [unpack(bytes), row];
  } catch (error) {
    if (address.read().scenario === id) fill(find("player"), head(state, id, back, listed), make("p", { class: "problem", role: "alert" }, error.message));
    return;
  }
  if (address.read().scenario !== id) return; // another scenario was opened in the meantime
  playing = new Player(lake, scene, facts, head(state, id, back, listed), () => go({ ...address.elsewhere, scenario: "" }));
  playing.restore(state);
}

function head(state, id, back, listed) {
  const place = listed.indexOf(id);
  const beside = (step, label, words) => {
    const other = place < 0 ? undefined : listed[place + step];
    return other ? make("a", { class: "button", href: address.href({ ...state, ...address.elsewhere, scenario: other }), "aria-label": words }, label) : null;
  };
  return make(
    "div", { class: "bar" },
    make("a", { class: "button", href: back }, "‹ All scenarios"),
    make("h1", { class: "id" }, id),
    make("span", { class: "beside" }, beside(-1, "‹", "Previous scenario"), beside(1, "›", "Next scenario")),
  );
}

class Player {
  constructor(lake, scene, facts, bar, onEnd) {
    Object.assign(this, { scene, onEnd });
    this.clock = new Clock(scene.duration);
    this.clock.set(scene.time[scene.now]);
    const canvas = make("canvas", { tabindex: "0", role: "img", "aria-label": `Scenario ${scene.id} from above; space plays, arrow keys step, plus and minus zoom` });
    this.tip = make("div", { class: "tip", "aria-hidden": "true", hidden: true });
    this.chosen = make("div", { class: "chosen", "aria-live": "off" });
    this.controls = controls(this, layers);
    const style = matchMedia("(prefers-color-scheme: dark)").matches ? lake.darkPicture : lake.picture;
    const picture = make("div", { class: "picture" }, canvas, this.tip, this.controls.view, legend(style, scene));
    const side = make(
      "aside", { "aria-label": "Properties" },
      make("h2", {}, "Object"), this.chosen,
      make("details", { open: true }, make("summary", {}, plural(scene.numObjects, "object")), this.objectList()),
      make("details", {}, make("summary", {}, "Scenario"), scenarioFacts(lake, facts)),
    );
    fill(find("player"), bar, make("div", { class: "stage" }, make("div", { class: "screen" }, picture, this.controls.bar), side));
    this.stage = new Stage(canvas, scene, style, layers, this.clock);
    this.stage.onHover = (under) => this.showTip(under);
    this.stage.onPick = (row) => { this.pick(row); this.remember(); };
    this.stage.onMove = () => this.controls.update();
    this.sized = new ResizeObserver(() => this.stage.resize());
    this.sized.observe(canvas);
    this.onKey = (event) => this.press(event);
    document.addEventListener("keydown", this.onKey);
    this.pick(scene.ego);
    this.frame = requestAnimationFrame((now) => this.run(now));
    find("content").focus({ preventScroll: true }); // so that keyboard shortcuts work immediately
  }

  // Show the time and the object of an address.
  restore({ at, object, follow }) {
    const row = this.scene.objects.findIndex(({ id }) => id === object);
    if (row >= 0) this.pick(row);
    if (at !== "" && Number.isFinite(Number(at))) this.clock.set(Number(at));
    if (follow) this.follow(true);
    this.changed();
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
    });
  }

  close() {
    cancelAnimationFrame(this.frame);
    this.sized.disconnect();
    document.removeEventListener("keydown", this.onKey);
  }

  run(now) {
    const wasRunning = this.clock.isRunning;
    this.clock.tick(now);
    this.stage.paint(now, wasRunning);
    if (wasRunning) this.showTime();
    if (wasRunning && !this.clock.isRunning) this.remember();
    this.frame = requestAnimationFrame((next) => this.run(next));
  }

  showTime() {
    const { step } = this.scene.at(this.clock.time);
    this.controls.update();
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

  toggle() {
    this.clock.toggle();
    this.changed();
  }

  follow(isFollowed) {
    this.stage.follows = isFollowed;
    if (isFollowed) this.stage.camera.scale = Math.max(this.stage.camera.scale, this.stage.camera.width / 160);
    this.stage.moved();
    this.remember();
  }

  pick(row) {
    this.stage.objects.selected = row;
    for (const button of this.buttons.values()) button.removeAttribute("aria-current");
    this.buttons.get(row)?.setAttribute("aria-current", "true");
    this.showChosen();
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
      const object = this.scene.objects[row];
      const button = make("button", { type: "button", onclick: () => { this.pick(row); this.remember(); } }, make("span", {}, object.id), make("small", {}, row === this.scene.ego ? "ego" : words(object.type)));
      this.buttons.set(row, button);
      return make("li", {}, button);
    });
    return make("ul", { class: "objects" }, ...items);
  }

  press(event) {
    const isTyping = event.target.closest("input:not([type=range]):not([type=checkbox]), select, textarea, dialog");
    if (isTyping || event.ctrlKey || event.metaKey || event.altKey) return;
    const { step } = this.scene.at(this.clock.time);
    const isButton = event.target.closest("button, summary, a, input");
    const pan = (dx, dy) => { this.stage.camera.pan(dx, dy); this.stage.follows = false; this.stage.moved(); };
    const zoom = (factor) => { this.stage.camera.zoom(factor); this.stage.moved(); };
    const moves = {
      ArrowLeft: () => (event.shiftKey ? pan(60, 0) : this.goTo(step - 1)),
      ArrowRight: () => (event.shiftKey ? pan(-60, 0) : this.goTo(step + 1)),
      ArrowUp: () => event.shiftKey && pan(0, 60),
      ArrowDown: () => event.shiftKey && pan(0, -60),
      Home: () => this.goTo(0),
      End: () => this.goTo(this.scene.numSteps - 1),
      "+": () => zoom(1.25),
      "=": () => zoom(1.25),
      "-": () => zoom(0.8),
      0: () => this.stage.fitRoute(),
      f: () => this.follow(!this.stage.follows),
      Escape: () => this.onEnd(),
    };
    if (!isButton) moves[" "] = () => this.toggle();
    if (!(event.key in moves) || (event.key.startsWith("Arrow") && isButton && event.target.type !== "range")) return;
    if (moves[event.key]() !== false) event.preventDefault();
  }
}

// Legend of the colours that occur in a scene.
function legend(style, scene) {
  const types = [...new Set(scene.objects.filter((_, row) => row !== scene.ego).map(({ type }) => type))].sort();
  const item = (color, text) => {
    const sample = make("span", { class: "sample" });
    sample.style.background = color;
    return make("li", {}, sample, text);
  };
  return make("ul", { class: "legend", "aria-label": "Legend" }, item(style.ego, "ego"), ...types.map((type) => item(style.objects[type], words(type))));
}
