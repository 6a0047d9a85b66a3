// The filter box: completes column names and marks the position of errors.

import { find, make, fill } from "/static/elements.js";

const most = 8;
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
  find("clear").addEventListener("click", () => go({ where: "", database: "", ranges: "", page: 1 }));
  find("database").addEventListener("change", (event) => go({ database: event.target.value, page: 1 }));
  const box = find("where");
  box.addEventListener("input", suggest);
  box.addEventListener("blur", hide);
  box.addEventListener("keydown", onKey);
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
  const near = text.length < 2 ? [] : columns.filter(({ name }) => name.includes(text) && name !== text);
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
