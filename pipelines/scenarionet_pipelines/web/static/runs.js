// The runs of a scenario: which there are, and those that are shown beside the recording.

import { fill, make } from "/static/elements.js";
import { cell, number, plural } from "/static/format.js";
import { unpackRun } from "/static/scene.js";
import { getBytes, getJson } from "/static/server.js";

export const most = 3;

const references = { replay: "recording", constant: "constant velocity", random: "random actions" };

// Name of a rollout in addresses, and for people.
function keyOf({ run, rollout }) {
  return rollout ? `${run}:${rollout}` : run;
}

// What a run is compared with by `scenarionet sim`, in words; undefined for other runs.
function referenceOf({ run, rollout }) {
  const name = references[run.match(/^reference-(\w+)-[0-9a-f]{12}$/)?.[1]];
  return name && (rollout ? `${name}, ${rollout + 1}` : name);
}

export class Runs {
  // `onChange` is called when other runs are shown.
  constructor(scene, style, onChange) {
    Object.assign(this, { scene, style, onChange });
    this.listed = [];
    this.shown = []; // in the order of their colours
    this.element = make("div", { class: "runs" }, make("p", {}, "Looking for runs…"));
  }

  get keys() {
    return this.shown.map(({ key }) => key);
  }

  // The last moment of all runs that are shown [s].
  get duration() {
    return Math.max(0, ...this.shown.map(({ duration }) => duration));
  }

  // List the runs, and show those with the given keys.
  async load(keys) {
    try {
      this.listed = await getJson("/api/runs", { id: this.scene.id });
      const known = new Set(this.listed.map(keyOf));
      for (const key of keys.filter((each) => known.has(each)).slice(0, most)) await this.add(key);
    } catch (error) {
      fill(this.element, make("p", { class: "problem", role: "alert" }, error.message));
      return;
    }
    this.describe();
    this.onChange();
  }

  async add(key) {
    const color = this.style.runs.find((each) => this.shown.every((run) => run.color !== each));
    this.shown.push(unpackRun(await getBytes("/api/run", { id: this.scene.id, run: key }), this.scene, key, color));
  }

  async toggle(key, isShown) {
    if (!isShown) this.shown = this.shown.filter((run) => run.key !== key);
    else await this.add(key);
    this.describe();
    this.onChange();
  }

  describe() {
    if (!this.listed.length) return fill(this.element, make("p", {}, "No run of this scenario yet. Simulate it with ", make("code", {}, "scenarionet sim"), "."));
    const results = [...new Map(this.listed.map((result) => [keyOf(result), result])).values()];
    const list = (listed) => make("ul", {}, ...listed.map((result) => this.item(keyOf(result), result)));
    const folded = results.filter(referenceOf);
    const isMixed = new Set(results.map((result) => result.rule)).size > 1;
    const isOpen = this.element.querySelector("details")?.open ?? false;
    fill(
      this.element,
      make("p", {}, `Shown beside the recording, up to ${most} at a time.`),
      isMixed ? make("p", {}, "Not all are scored by the same rule, as earlier versions had others; see ", make("code", {}, "scenarionet runs compare"), ".") : null,
      list(results.filter((result) => !referenceOf(result))),
      folded.length ? make("details", { open: isOpen }, make("summary", {}, "References"), list(folded)) : null,
    );
  }

  item(key, result) {
    const run = this.shown.find((each) => each.key === key);
    const box = make("input", { type: "checkbox", checked: Boolean(run), disabled: !result.has_motion || (!run && this.shown.length >= most) });
    box.addEventListener("change", () => this.toggle(key, box.checked));
    const sample = make("span", { class: "sample" });
    if (run) sample.style.background = run.color;
    const crashes = result.cost ? plural(result.cost, "crash").replace("crashs", "crashes") : "no crash";
    const score = result.nuplan_score === null ? "" : ` · nuPlan ${number(result.nuplan_score)}`;
    const stored = result.has_motion ? "" : " · motion not stored";
    return make(
      "li", {}, make("label", {}, box, sample, make("span", {}, referenceOf(result) ?? key)),
      make("small", {}, `${cell(result.status).replaceAll("_", " ")} · ${crashes}${score}${stored}`),
    );
  }
}
