// Histograms of chosen columns above the table; brushing one keeps the scenarios in its range.

import * as address from "/static/address.js";
import { fill, find, make } from "/static/elements.js";
import { number, plural } from "/static/format.js";
import { getJson } from "/static/server.js";

const most = 4;
let known = {};
let asking = null;

// The ranges of an address: [column, least, most], either end may be empty.
export function rangesOf(state) {
  return state.ranges.split(",").filter(Boolean).map((text) => text.split(":")).filter(([column, low, high]) => known[column]?.is_number && isEnd(low) && isEnd(high));
}

function isEnd(text) {
  return text === "" || (text !== undefined && Number.isFinite(Number(text)));
}

// The condition of the filter box, of the chosen moments and of all ranges but that of one column.
export function conditionOf(state, without = "") {
  const moments = state.moments ? [happens(state.moments)] : [];
  const parts = rangesOf(state).filter(([column]) => column !== without).flatMap(([column, low, high]) => [low && `"${column}" >= ${Number(low)}`, high && `"${column}" <= ${Number(high)}`].filter(Boolean)).concat(moments);
  if (!parts.length) return state.where;
  return [state.where && `(${state.where}\n)`, ...parts].filter(Boolean).join(" AND ");
}

// The condition that moments of a name, or of one of its definitions (NAME/DEFINITION), are kept of a scenario.
function happens(chosen) {
  const [name, definition] = chosen.split("/").map((text) => `'${text.replaceAll("'", "''")}'`);
  const also = definition ? ` AND definition = ${definition}` : "";
  return `scenario_id IN (SELECT scenario_id FROM moments WHERE name = ${name}${also})`;
}

export function startHistograms(lake, go) {
  known = Object.fromEntries(lake.columns.map((column) => [column.name, column]));
  const numeric = lake.columns.filter((column) => column.is_number && !column.of_run).map(({ name }) => make("option", { value: name }, name));
  fill(find("add-chart"), make("option", { value: "" }, "Histogram…"), ...numeric);
  find("add-chart").addEventListener("change", (event) => {
    const charts = chartsOf(address.read());
    const name = event.target.value;
    event.target.value = "";
    if (name && !charts.includes(name)) go({ charts: [...charts, name].slice(-most).join(",") });
  });
}

function chartsOf(state) {
  return state.charts.split(",").filter((name) => known[name]?.is_number).slice(0, most);
}

// Show the histograms of an address.
export async function showHistograms(state, go) {
  asking?.abort();
  const mine = (asking = new AbortController());
  const charts = chartsOf(state);
  find("charts").hidden = !charts.length;
  const shown = [];
  for (const column of charts) { // one at a time, so that the table does not wait for them
    let histogram;
    try {
      histogram = await getJson("/api/histogram", { column, where: conditionOf(state, column), database: state.database, run: state.run }, mine.signal);
    } catch (error) {
      if (error.name === "AbortError") return;
      shown.push(make("figure", { class: "chart" }, make("p", {}, `${column}: ${error.message}`)));
      continue;
    }
    shown.push(chart(histogram, column, state, go));
  }
  fill(find("charts"), ...shown);
}

function chart(histogram, name, state, go) {
  const { low, high, counts, missing } = histogram;
  const [, from, to] = rangesOf(state).find(([column]) => column === name) ?? [name, "", ""];
  const keep = (least, largest) => {
    const others = rangesOf(state).filter(([column]) => column !== name);
    const range = least === "" && largest === "" ? [] : [[name, least, largest]];
    go({ ranges: [...others, ...range].map((each) => each.join(":")).join(",") });
  };
  const remove = () => {
    const ranges = rangesOf(state).filter(([column]) => column !== name).map((each) => each.join(":")).join(",");
    go({ charts: chartsOf(state).filter((each) => each !== name).join(","), ranges });
  };
  const unit = known[name].unit;
  const head = make("div", { class: "row" }, make("strong", { title: known[name].doc }, name), make("small", {}, unit), make("span", { class: "space" }), make("button", { type: "button", class: "small", "aria-label": `Remove the histogram of ${name}`, onclick: remove }, "×"));
  if (low === null) return make("figure", { class: "chart" }, head, make("p", {}, "no values"));
  const width = (high - low) / counts.length;
  const tallest = Math.max(1, ...counts);
  const bars = counts.map((count, place) => {
    const begin = low + place * width;
    const isKept = (from === "" || begin + width > Number(from)) && (to === "" || begin < Number(to));
    const bar = make("span", { class: isKept ? "bar-of" : "bar-of out", title: `${number(begin)} to ${number(begin + width)}: ${plural(count, "scenario")}` });
    bar.style.height = `${count ? Math.max(2, (100 * count) / tallest) : 0}%`;
    return make("span", { class: "slot" }, bar);
  });
  const area = make("div", { class: "bars", role: "img", "aria-label": `Histogram of ${name} from ${number(low)} to ${number(high)}; at most ${plural(tallest, "scenario")} in one of ${counts.length} bins` }, ...bars);
  brush(area, (first, last) => keep(ends(low + first * width), ends(low + last * width)));
  const field = (label, value, change) => {
    const box = make("input", { type: "number", step: "any", value, placeholder: label, "aria-label": `${name}, ${label}` });
    box.addEventListener("change", () => change(box.value));
    return box;
  };
  const clear = make("button", { type: "button", class: "small", hidden: from === "" && to === "", onclick: () => keep("", "") }, "All");
  const lower = make("div", { class: "row ends" }, field("from", from, (value) => keep(value, to)), make("span", {}, "–"), field("to", to, (value) => keep(from, value)), clear, make("small", {}, missing ? `${number(missing)} without` : ""));
  return make("figure", { class: "chart", "data-column": name }, head, area, make("div", { class: "limits" }, make("small", {}, number(low)), make("small", {}, number(high))), lower);
}

// Mark the bins under a drag; `take(first, last)` gets the bins in order, the last one exclusive.
function brush(area, take) {
  let start = null;
  const at = (event) => {
    const box = area.getBoundingClientRect();
    return Math.min(area.children.length - 1, Math.max(0, Math.floor(((event.clientX - box.left) / box.width) * area.children.length)));
  };
  const mark = (first, last) => [...area.children].forEach((slot, place) => slot.classList.toggle("brushed", place >= first && place <= last));
  area.addEventListener("pointerdown", (event) => { area.setPointerCapture(event.pointerId); start = at(event); mark(start, start); });
  area.addEventListener("pointermove", (event) => { if (start !== null) mark(Math.min(start, at(event)), Math.max(start, at(event))); });
  area.addEventListener("pointerup", (event) => {
    const end = at(event);
    take(Math.min(start, end), Math.max(start, end) + 1);
    start = null;
  });
}

function ends(value) {
  return String(Number(value.toPrecision(6)));
}
