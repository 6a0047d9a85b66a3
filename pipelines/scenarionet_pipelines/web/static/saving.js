// Dialog that saves the filtered scenarios as a database; available if the server was started with --write.

import * as address from "/static/address.js";
import { find, make, fill } from "/static/elements.js";
import { plural } from "/static/format.js";
import { conditionOf } from "/static/histograms.js";
import { post } from "/static/server.js";

export function startSaving(lake, showDatabases) {
  find("save").hidden = !lake.isWritable;
  find("save").addEventListener("click", () => ask(lake, showDatabases));
}

function ask(lake, showDatabases) {
  const dialog = find("saving");
  const state = address.read();
  const [where, database, run] = [conditionOf(state), state.database, state.run];
  const name = make("input", { name: "name", required: true, pattern: "[A-Za-z0-9_][A-Za-z0-9._\\-]*", autocomplete: "off" });
  const said = make("p", { class: "said", role: "alert" });
  const close = make("button", { type: "button", onclick: () => dialog.close() }, "Cancel");
  const save = make("button", { type: "submit", class: "primary" }, "Save");
  const form = make(
    "form", {},
    make("h2", { id: "saving-title" }, "Save as a database"),
    make("p", {}, "A database is a list of these scenarios together with the query that selected them; nothing is copied."),
    make("dl", {}, make("dt", {}, "from"), make("dd", {}, [database || "whole lake", run && `with results of ${run}`].filter(Boolean).join(", ")), make("dt", {}, "where"), make("dd", {}, make("code", {}, where || "true"))),
    make("label", { class: "field" }, make("span", {}, "Name"), name),
    said,
    make("div", { class: "buttons" }, close, save),
  );
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    save.disabled = true;
    try {
      const made = await post("/api/databases", { name: name.value, where, database, run }, lake.secret);
      showDatabases(made.databases);
      said.className = "said good";
      said.textContent = `${made.reference}: ${plural(made.count, "scenario")} saved`;
      close.textContent = "Close";
      close.focus();
    } catch (error) {
      said.className = "said bad";
      said.textContent = error.message;
      save.disabled = false;
    }
  });
  fill(dialog, form);
  dialog.showModal();
  name.focus();
}
