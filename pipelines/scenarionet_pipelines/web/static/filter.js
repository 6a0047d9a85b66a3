// The filter box: completes column names and marks the position of errors.

import * as address from "/static/address.js";
import { find, make, fill } from "/static/elements.js";
import { number } from "/static/format.js";

const most = 8;
const ofRun = ["success", "status", "nuplan_score", "route_completion", "cost", "min_time_to_collision", "error"];
let columns = [];
let chosen = -1;

export function startFilter(lake, go) {
  columns = lake.columns;
  const form = find("filter");
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    hide();
    go({ where: find("where").value.trim(), page: 1 });
  });
  find("clear").addEventListener("click", () => go({ where: "", database: "", moments: "", ranges: "", ...withRun(""), page: 1 }));
  offer("run", "none", lake.runs.map(({ run, scenarios, failed }) => [run, `${run}: ${failed} of ${scenarios} failed`]));
  find("run").addEventListener("change", (event) => go({ ...withRun(event.target.value), page: 1 }));
  const names = [...new Set(lake.moments.map(({ name }) => name))];
  offer("moments", "any or none", names.flatMap((name) => [[name, name], ...lake.moments.filter((each) => each.name === name).map(({ definition, moments }) => [`${name}/${definition}`, `${name}: ${definition} (${number(moments)})`])]));
  find("moments").addEventListener("change", (event) => go({ moments: event.target.value, page: 1 }));
  find("database").addEventListener("change", (event) => go({ database: event.target.value, page: 1 }));
  const box = find("where");
  box.addEventListener("input", suggest);
  box.addEventListener("blur", hide);
  box.addEventListener("keydown", onKey);
}

// Fill a choice, which is shown if there is something to choose.
function offer(id, nothing, choices) {
  find(id).closest("label").hidden = !choices.length;
  fill(find(id), make("option", { value: "" }, nothing), ...choices.map(([value, text]) => make("option", { value }, text)));
}

// The state of the page with a run: its scenarios, those that failed first, with columns of its results.
function withRun(run) {
  const isOfRun = (name) => columns.find((column) => column.name === name)?.of_run;
  const { columns: shown, sort, order } = address.read();
  const others = shown.split(",").filter((name) => !isOfRun(name));
  if (!run) return { run, columns: others.join(","), ...(isOfRun(sort) ? { sort: "scenario_id", order: "rising" } : { sort, order }) };
  return { run, columns: [...ofRun, ...others].join(","), sort: "success", order: "rising" };
}

// The word before the cursor and its start.
function word() {
  const box = find("where");
  const before = box.value.slice(0, box.selectionStart);
  const [found] = before.match(/[A-Za-z_]\w*$/) ?? [""];
  const isText = (before.match(/'/g) ?? []).length % 2 === 1;
  return { start: before.length - found.length, text: isText ? "" : found.toLowerCase() };
}

function suggest() {
  const { text } = word();
  const near = text.length < 2 ? [] : columns.filter(({ name, of_run }) => name.includes(text) && name !== text && (!of_run || address.read().run));
  near.sort((a, b) => a.name.indexOf(text) - b.name.indexOf(text));
  if (!near.length) return hide();
  chosen = -1;
  fill(find("suggestions"), ...near.slice(0, most).map(suggestion));
  find("suggestions").hidden = false;
  find("where").setAttribute("aria-expanded", "true");
}

function suggestion(column, place) {
  const unit = column.unit ? ` [${column.unit}]` : "";
  return make(
    "li",
    { role: "option", id: `suggestion-${place}`, "data-name": column.name, "aria-selected": "false",
      onmousedown: (event) => { event.preventDefault(); take(column.name); } },
    make("code", {}, column.name), unit, make("small", {}, column.doc),
  );
}

function hide() {
  find("suggestions").hidden = true;
  find("where").setAttribute("aria-expanded", "false");
  find("where").removeAttribute("aria-activedescendant");
  chosen = -1;
}

function take(name) {
  const box = find("where");
  const { start } = word();
  const rest = box.value.slice(box.selectionStart);
  box.value = `${box.value.slice(0, start)}${name}${rest}`;
  box.setSelectionRange(start + name.length, start + name.length);
  hide();
}

function onKey(event) {
  const options = [...find("suggestions").children];
  if (find("suggestions").hidden || !options.length) return;
  if (event.key === "Escape") hide();
  else if (event.key === "ArrowDown" || event.key === "ArrowUp") choose(options, event.key === "ArrowDown" ? 1 : -1);
  else if ((event.key === "Enter" || event.key === "Tab") && chosen >= 0) take(options[chosen].dataset.name);
  else return;
  event.preventDefault();
}

function choose(options, step) {
  chosen = (chosen + step + options.length) % options.length;
  options.forEach((option, place) => option.setAttribute("aria-selected", String(place === chosen)));
  options[chosen].scrollIntoView({ block: "nearest" });
  find("where").setAttribute("aria-activedescendant", options[chosen].id);
}

// Show an error of the server and mark its position in the condition; null clears it.
export function showProblem(error) {
  const problem = find("problem");
  problem.hidden = !error;
  find("where").toggleAttribute("aria-invalid", Boolean(error?.character));
  if (!error) return fill(problem);
  const text = find("where").value;
  const place = (error.character ?? 0) - 1;
  const end = place + (text.slice(place).match(/^\w+/)?.[0].length ?? 1);
  const shown = place >= 0 && place <= text.length && text
    ? make("code", {}, text.slice(0, place), make("mark", {}, text.slice(place, end) || " "), text.slice(end))
    : null;
  fill(problem, make("span", {}, error.message), shown);
}
