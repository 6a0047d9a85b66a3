// Below the controls: speed and acceleration of an object over time, and what happens, beside a cursor at the time.

import { events as eventsOf, moments as momentsOf, told } from "/static/events.js";
import { fill, make } from "/static/elements.js";
import { rounded } from "/static/format.js";

const svg = "http://www.w3.org/2000/svg";
const wide = 1000; // units of a plot; it is stretched to its element
const high = 100;
const margin = 4;
const dashes = ["", "7 3", "2 3"];
const manyMoments = 24; // of a name, from which on only those of the selected object are shown
const lettering = 6.6; // [pixel] mean width of a letter of an event

const plots = [
  { name: "speed", unit: "m/s", values: (motion, row) => motion.speeds(row), least: [0, 5] },
  { name: "acceleration", unit: "m/s²", values: (motion, row) => motion.accelerations(row), least: [-2, 2] },
];

export class Timeline {
  // `seek(time)` goes to a time, `pick(row)` selects an object.
  constructor(scene, style, runs, seek, pick) {
    Object.assign(this, { scene, style, runs, seek, pick });
    this.duration = scene.duration;
    this.row = scene.ego;
    this.recorded = []; // events of the recording, as they are found
    this.kept = []; // moments that the lake keeps, by name
    this.plots = plots.map((plot) => this.frame(plot));
    this.rows = make("div", { class: "events" });
    this.cursor = make("div", { class: "cursor", "aria-hidden": "true" });
    this.subject = make("span");
    this.area = make("div", { class: "over-time" }, ...this.plots.map(({ element }) => element), this.rows, this.cursor);
    this.element = make("section", { class: "timeline", "aria-label": "Over time" }, make("h2", {}, "Over time: ", this.subject), this.area);
    this.listen();
    this.sized = new ResizeObserver(() => this.showEvents());
    this.sized.observe(this.area);
    this.events = eventsOf(scene, (found) => { this.recorded.push(...found); this.showEvents(); });
    momentsOf(scene, this.events.signal).then((found) => { this.kept = found; this.showEvents(); }, (error) => console.info(`moments are not shown: ${error.message}`));
  }

  close() {
    this.sized.disconnect();
    this.events.abort();
  }

  frame(plot) {
    const picture = document.createElementNS(svg, "svg");
    picture.setAttribute("viewBox", `0 0 ${wide} ${high}`);
    picture.setAttribute("preserveAspectRatio", "none");
    picture.setAttribute("role", "img");
    const [upper, lower, now] = [make("small", { class: "upper" }), make("small", { class: "lower" }), make("output", { class: "now" })];
    const title = make("span", { class: "name" }, `${plot.name} `, make("small", {}, plot.unit));
    return { ...plot, picture, upper, lower, now, element: make("div", { class: "plot" }, make("div", { class: "what" }, title, now), make("div", { class: "curves" }, picture, upper, lower)) };
  }

  listen() {
    const at = (event) => {
      const box = this.plots[0].picture.getBoundingClientRect();
      this.seek(((event.clientX - box.left) / box.width) * this.duration);
    };
    for (const { picture } of this.plots) {
      picture.addEventListener("pointerdown", (event) => { picture.setPointerCapture(event.pointerId); at(event); });
      picture.addEventListener("pointermove", (event) => { if (event.buttons & 1) at(event); });
    }
  }

  // Draw the curves of an object, in the recording and in the runs.
  show(row) {
    this.row = row < 0 ? this.scene.ego : row;
    this.duration = Math.max(this.scene.duration, this.runs.duration);
    this.subject.textContent = this.row === this.scene.ego ? "the ego" : this.scene.names[this.row];
    this.curves = [{ name: "recording", motion: this.scene, color: this.color() }, ...this.runs.shown.map((run) => ({ name: run.key, motion: run, color: run.color }))];
    for (const plot of this.plots) this.draw(plot);
    this.showEvents();
  }

  color() {
    return this.row === this.scene.ego ? this.style.ego : this.style.objects[this.scene.objects[this.row].type];
  }

  draw(plot) {
    plot.series = this.curves.map(({ motion }) => plot.values(motion, this.row));
    const known = plot.series.flatMap((values) => [...values]).filter((value) => !Number.isNaN(value));
    const [least, most] = rounded(Math.min(plot.least[0], ...known), Math.max(plot.least[1], ...known));
    const y = (value) => high - margin - ((value - least) / (most - least)) * (high - 2 * margin);
    const lines = this.curves.map(({ motion, color }, place) => this.line(motion.time, plot.series[place], y, color, place));
    const zero = path(`M0 ${y(0)}H${wide}`, "zero");
    fill(plot.picture, zero, ...lines);
    plot.picture.setAttribute("aria-label", `${plot.name} of ${this.subject.textContent} over ${this.duration.toFixed(1)} s, on an axis from ${least} to ${most} ${plot.unit}: ${this.curves.map(({ name }) => name).join(", ")}`);
    [plot.upper.textContent, plot.lower.textContent] = [most, least];
  }

  line(time, values, y, color, place) {
    let text = "";
    let isDrawing = false;
    values.forEach((value, step) => {
      const isKnown = !Number.isNaN(value);
      if (isKnown) text += `${isDrawing ? "L" : "M"}${((time[step] / (this.duration || 1)) * wide).toFixed(1)} ${y(value).toFixed(1)}`;
      isDrawing = isKnown;
    });
    const line = path(text, "curve");
    line.style.stroke = color;
    line.style.strokeDasharray = place ? dashes[place - 1] : "";
    return line;
  }

  // Move the cursor and show the values at a time.
  update(time) {
    const width = this.plots[0].picture.getBoundingClientRect();
    this.cursor.style.transform = `translateX(${width.left - this.area.getBoundingClientRect().left + (time / (this.duration || 1)) * width.width}px)`;
    for (const plot of this.plots) {
      fill(plot.now, ...this.curves.map(({ motion, color }, place) => {
        const sample = make("span", { class: "sample" });
        sample.style.background = color;
        const value = plot.series[place][motion.at(time).step];
        const isThere = time >= motion.time[0] - 1e-3 && !Number.isNaN(value);
        return make("span", {}, sample, isThere ? (Math.round(10 * value) / 10 + 0).toFixed(1) : "–");
      }));
    }
  }

  showEvents() {
    const box = this.plots[0].picture.getBoundingClientRect();
    if (!box.width) return;
    const runs = this.runs.shown.map((run) => [run.key, run.color, outcomes(run, this.runs.listed)]);
    const kept = this.kept.map(([name, found]) => [`moments ${name}`, "transparent", this.ofSelected(found)]);
    const rows = [["recording", this.style.ego, this.recorded], ...kept, ...runs].filter(([, , found]) => found.length);
    fill(this.rows, ...rows.map(([name, color, found]) => this.eventRow(name, color, found, box.width)));
  }

  // All moments of a name, or those in which the selected object has a role if they are many.
  ofSelected(found) {
    const { id } = this.scene.objects[this.row];
    return found.length <= manyMoments ? found : found.filter(({ track, other }) => track === id || other === id);
  }

  eventRow(name, color, found, width) {
    const ends = []; // where each lane is free again [pixel]
    const marks = [...found].sort((a, b) => a.first - b.first).map((event) => {
      const text = told(event, this.scene);
      const size = Math.max(24, 16 + lettering * text.length);
      const left = Math.min((event.first / (this.duration || 1)) * width, width - size);
      let lane = ends.findIndex((end) => end <= left);
      if (lane < 0) lane = ends.push(0) - 1;
      ends[lane] = left + size + 3;
      const said = `${text}, ${event.first.toFixed(1)}${event.last > event.first ? ` to ${event.last.toFixed(1)}` : ""} s`;
      const mark = make("button", { type: "button", class: `event ${event.kind}`, title: said, "aria-label": said, onclick: () => this.open(event) }, text);
      mark.style.left = `${left}px`;
      mark.style.top = `${27 * lane}px`;
      return mark;
    });
    const strip = make("div", { class: "strip" }, ...marks);
    strip.style.height = `${27 * Math.max(1, ends.length)}px`;
    const sample = make("span", { class: "sample" });
    sample.style.background = color;
    return make("div", { class: "event-row", role: "group", "aria-label": `Events of ${name}` }, make("div", { class: "what" }, make("span", { class: "name" }, sample, name)), strip);
  }

  open(event) {
    const row = this.scene.objects.findIndex(({ id }) => id === event.track);
    if (row >= 0) this.pick(row);
    this.seek(event.first);
  }
}

// Events of a run: those found in its motion, and how it ended.
function outcomes(run, listed) {
  const ends = listed.filter((result) => result.run === run.run && result.rollout === run.rollout && result.outcome_time !== null);
  return [...run.events, ...ends.map(({ status, outcome_time, track_id }) => ({ kind: status, first: run.time[0] + outcome_time, last: run.time[0] + outcome_time, track: track_id }))];
}

function path(text, kind) {
  const found = document.createElementNS(svg, "path");
  found.setAttribute("d", text || "M0 0");
  found.setAttribute("class", kind);
  return found;
}
