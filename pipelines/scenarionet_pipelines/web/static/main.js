// Entry point of the page: shows the state stored in its address and updates the address on changes.

import * as address from "/static/address.js";
import { find, make, fill } from "/static/elements.js";
import { startEvents } from "/static/events.js";
import { startFilter, showProblem } from "/static/filter.js";
import { plural } from "/static/format.js";
import { showHistograms, startHistograms } from "/static/histograms.js";
import { openPlayer, closePlayer } from "/static/player.js";
import { startSaving } from "/static/saving.js";
import { getJson } from "/static/server.js";
import { startTable, showTable } from "/static/table.js";

let lake;

async function show(state) {
  const isPlaying = Boolean(state.scenario);
  find("list").hidden = isPlaying;
  find("filter").hidden = find("where-hint").hidden = isPlaying;
  find("player").hidden = !isPlaying;
  document.title = `${state.scenario || lake.name} – ScenarioNet lake`;
  find("where").value = state.where;
  for (const name of ["database", "run", "moments"]) find(name).value = state[name];
  showProblem(null);
  if (isPlaying) {
    await openPlayer(lake, state, go);
  } else {
    closePlayer();
    if (!(await showTable(lake, state, showProblem))) return;
    await showHistograms(state, go);
  }
}

// Change the state; a new filter, database or order starts at the first page.
function go(changes) {
  const before = address.read();
  const state = { ...before, ...changes };
  const isOther = ["where", "database", "run", "moments", "sort", "order", "rows", "ranges"].some((name) => String(state[name]) !== String(before[name]));
  if (isOther && !("page" in changes)) state.page = 1;
  address.write(state);
  return show(state);
}

function showDatabases(names) {
  fill(find("database"), make("option", { value: "" }, "whole lake"), ...names.map((name) => make("option", { value: name }, name)));
  find("database").value = address.read().database;
}

function onLink(event) {
  const link = event.target.closest("a[href^='/']");
  if (!link || event.button || event.metaKey || event.ctrlKey || event.shiftKey) return;
  event.preventDefault();
  history.pushState(null, "", link.getAttribute("href"));
  show(address.read());
  scrollTo(0, 0);
}

async function start() {
  try {
    lake = await getJson("/api/about");
  } catch (error) {
    find("lake-facts").textContent = "";
    showProblem(error);
    return;
  }
  find("lake-name").textContent = lake.name;
  find("lake-facts").textContent = `${plural(lake.scenarios, "scenario")} · snapshot ${lake.snapshot} · ${lake.isWritable ? "writable" : "read-only"}`;
  find("lake-facts").title = `${lake.path}, ${lake.software}`;
  showDatabases(lake.databases);
  startFilter(lake, go);
  startHistograms(lake, go);
  startTable(lake, go);
  startEvents(lake);
  startSaving(lake, showDatabases);
  addEventListener("popstate", () => show(address.read()));
  document.addEventListener("click", onLink);
  await show(address.read());
}

start();
