// The table of scenarios: one page, sortable headers and the choice of columns.

import * as address from "/static/address.js";
import { find, make, fill } from "/static/elements.js";
import { cell, number, plural } from "/static/format.js";
import { conditionOf } from "/static/histograms.js";
import { forgetPictures, showWhenSeen } from "/static/pictures.js";
import { getJson } from "/static/server.js";

let asking = null;
let numPages = 1;
let known = {};

export function startTable(lake, go) {
  known = Object.fromEntries(lake.columns.map((column) => [column.name, column]));
  const turn = (page) => { go({ page: Math.min(Math.max(1, page), numPages) }); find("content").scrollIntoView(); };
  const now = () => address.read().page;
  find("first").addEventListener("click", () => turn(1));
  find("previous").addEventListener("click", () => turn(now() - 1));
  find("next").addEventListener("click", () => turn(now() + 1));
  find("last").addEventListener("click", () => turn(numPages));
  find("page").addEventListener("change", (event) => turn(Number.parseInt(event.target.value, 10) || 1));
  find("page-size").addEventListener("change", (event) => go({ rows: event.target.value }));
  find("view").addEventListener("click", () => go({ view: address.read().view ? "" : "gallery" }));
  find("sort").addEventListener("change", (event) => go({ sort: event.target.value }));
  find("order").addEventListener("click", () => go({ order: address.read().order === "falling" ? "rising" : "falling" }));
  find("table").addEventListener("click", (event) => {
    const sort = event.target.closest("button[data-sort]")?.dataset.sort;
    if (!sort) return;
    const { sort: before, order } = address.read();
    const isNumber = known[sort].is_number; // numbers are sorted from the largest first
    go({ sort, order: sort === before ? (order === "falling" ? "rising" : "falling") : isNumber ? "falling" : "rising" });
  });
  startChooser(lake, go);
}

// The scenarios before and after one in the order of the table, each with its page: [previous, next], or less at an end.
export async function beside(state) {
  const { database, run, sort, order, page, rows } = state;
  const first = Math.max(0, (page - 1) * rows - 1); // one more than the page, at either end
  const found = await getJson("/api/rows", { where: conditionOf(state), database, run, sort, order, first, count: Math.min(rows + 2, 200), columns: "" });
  const place = found.rows.findIndex((row) => row.scenario_id === state.scenario);
  if (place < 0) return [];
  return [place - 1, place + 1].map((other) => found.rows[other] && { scenario: found.rows[other].scenario_id, page: Math.floor((first + other) / rows) + 1 });
}

// Whether a column can be shown: those of results belong to a run.
function isShown(name, { run }) {
  return Boolean(known[name]) && (!known[name].of_run || Boolean(run));
}

// Show a page of the table; returns false if a newer request has replaced it.
export async function showTable(lake, state, showProblem) {
  asking?.abort();
  forgetPictures();
  const mine = (asking = new AbortController());
  const columns = state.columns.split(",").filter((name) => isShown(name, state));
  find("table").setAttribute("aria-busy", "true");
  const patience = setTimeout(() => { find("count").textContent = "Searching…"; }, 400);
  find("page-size").value = String(state.rows);
  find("frame").classList.toggle("gallery", state.view === "gallery");
  find("view").setAttribute("aria-pressed", String(state.view === "gallery"));
  let found;
  try {
    const { database, run, sort, order } = state;
    const parameters = { where: conditionOf(state), database, run, sort, order, first: (state.page - 1) * state.rows, count: state.rows, columns: columns.join(",") };
    found = await getJson("/api/rows", parameters, mine.signal);
  } catch (error) {
    if (error.name !== "AbortError") showProblem(error);
    return false;
  } finally {
    clearTimeout(patience);
    if (mine === asking) find("table").removeAttribute("aria-busy");
  }
  showHead(columns, state);
  showChosen(columns, state);
  fill(find("table").tBodies[0], ...found.rows.map((row) => tableRow(lake, state, columns, row)));
  showPages(found, state);
  find("table").dataset.where = state.where; // marks the finished request, for tests
  return true;
}

function showHead(columns, state) {
  const head = (name, label) => {
    const column = known[name];
    const isSorted = state.sort === name;
    const unit = column.unit ? make("span", { class: "unit" }, column.unit) : null;
    const arrow = make("span", { class: "arrow", "aria-hidden": "true" }, isSorted ? (state.order === "falling" ? "▼" : "▲") : "");
    const inside = column.is_sortable
      ? make("button", { type: "button", "data-sort": name, title: column.doc }, label, arrow, unit)
      : make("span", { title: column.doc }, label, unit);
    const sorted = isSorted ? (state.order === "falling" ? "descending" : "ascending") : "none";
    return make("th", { scope: "col", "aria-sort": sorted, class: column.is_number ? "number" : "" }, inside);
  };
  const heads = columns.filter((name) => name !== "scenario_id").map((name) => head(name, name));
  fill(find("table").tHead, make("tr", {}, make("th", { scope: "col", class: "picture" }, make("span", { class: "unseen" }, "Picture")), head("scenario_id", "scenario"), ...heads));
  fill(find("sort"), ...Object.values(known).filter((column) => column.is_sortable && isShown(column.name, state)).map(({ name }) => make("option", { value: name }, name)));
  find("sort").value = state.sort;
  find("order").textContent = state.order === "falling" ? "↓" : "↑";
}

function tableRow(lake, state, columns, row) {
  const id = row.scenario_id;
  const link = address.href({ ...state, scenario: id, runs: state.runs || state.run });
  const picture = make("img", { alt: "", width: 128, height: 80, decoding: "async" });
  showWhenSeen(picture, `/api/thumbnail?${new URLSearchParams({ id, width: 256, height: 160, snapshot: lake.snapshot })}`);
  const cells = columns.filter((name) => name !== "scenario_id").map((name) =>
    make("td", { class: known[name].is_number ? "number" : "", "data-label": name, "data-unit": known[name].unit }, cell(row[name])));
  return make(
    "tr", {},
    make("td", { class: "picture" }, make("a", { href: link, tabindex: "-1", "aria-hidden": "true" }, picture)),
    make("th", { scope: "row", class: "id" }, make("a", { href: link }, id)),
    ...cells,
  );
}

function showPages({ total, first, rows }, state) {
  numPages = Math.max(1, Math.ceil(total / state.rows));
  find("count").textContent = total ? `${number(first + 1)}–${number(first + rows.length)} of ${plural(total, "scenario")}` : "";
  if (total && !rows.length) find("count").textContent = `page ${state.page} of ${numPages}: beyond the last`;
  find("nothing").hidden = total > 0;
  find("nothing").textContent = state.where || state.database || state.ranges || state.run || state.moments
    ? "No scenario matches this filter."
    : "This lake has no scenarios yet. Convert some: scenarionet convert DATASET RAW LAKE";
  find("page").value = String(state.page);
  find("page").max = String(numPages);
  find("num-pages").textContent = `of ${number(numPages)}`;
  for (const id of ["first", "previous"]) find(id).disabled = state.page <= 1;
  for (const id of ["next", "last"]) find(id).disabled = state.page >= numPages;
}

function startChooser(lake, go) {
  const sheet = find("chooser").querySelector(".sheet");
  const items = lake.columns.filter(({ name }) => name !== "scenario_id").map((column) =>
    make("label", { title: column.doc }, make("input", { type: "checkbox", value: column.name }), make("code", {}, column.name), make("small", {}, column.unit)));
  fill(sheet, ...items);
  sheet.addEventListener("change", () => {
    const chosen = [...sheet.querySelectorAll("input:checked")].map((input) => input.value);
    go({ columns: chosen.join(",") });
  });
  document.addEventListener("click", (event) => { if (!find("chooser").contains(event.target)) find("chooser").open = false; });
  find("chooser").addEventListener("keydown", (event) => { if (event.key === "Escape") find("chooser").open = false; });
}

function showChosen(columns, state) {
  for (const input of find("chooser").querySelectorAll("input")) {
    input.checked = columns.includes(input.value);
    input.closest("label").hidden = !isShown(input.value, state);
  }
}
