// Legend of the colours that occur in a scene, and of the runs beside it.

import { fill, make } from "/static/elements.js";
import { words } from "/static/format.js";

export class Legend {
  constructor(style, scene) {
    Object.assign(this, { style, scene });
    this.element = make("ul", { class: "legend", "aria-label": "Legend" });
  }

  show(runs) {
    const { style, scene } = this;
    const types = [...new Set(scene.objects.filter((_, row) => row !== scene.ego).map(({ type }) => type))].sort();
    const ego = item(style.ego, runs.length ? "ego, recorded" : "ego");
    fill(this.element, ego, ...types.map((type) => item(style.objects[type], words(type))), ...runs.map((run) => item(run.color, run.key, "run")));
  }
}

function item(color, text, kind = "") {
  const sample = make("span", { class: `sample ${kind}` });
  sample.style.background = color;
  return make("li", {}, sample, text);
}
