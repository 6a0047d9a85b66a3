// Dialog that lets the server draw a clip of the scenario and its runs, with progress, and offers the file.

import { fill, find, make } from "/static/elements.js";
import { plural } from "/static/format.js";

const types = { gif: "image/gif", mp4: "video/mp4" };

export function askClip(lake, scene, runs) {
  const dialog = find("clip");
  const stopped = new AbortController();
  const kind = make("select", {}, ...lake.clips.map((each) => make("option", { value: each }, each.toUpperCase())));
  const progress = make("progress", { max: 1, value: 0, "aria-label": "Frames drawn", hidden: true });
  const said = make("p", { class: "said", role: "status" });
  const start = make("button", { type: "submit", class: "primary" }, "Draw");
  const shown = ["the recording", ...runs.keys].join(", ");
  const form = make(
    "form", {},
    make("h2", { id: "clip-title" }, "Download a clip"),
    make("p", {}, `${shown}, ${runs.keys.length ? "side by side, " : ""}following the ego.`),
    make("label", { class: "field" }, make("span", {}, "Format"), kind),
    progress, said,
    make("div", { class: "buttons" }, make("button", { type: "button", onclick: () => dialog.close() }, "Close"), start),
  );
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    start.disabled = kind.disabled = true;
    progress.hidden = false;
    try {
      const onFrame = ({ done, of }) => {
        progress.value = (done + 1) / of;
        said.textContent = `frame ${done + 1} of ${of}`;
      };
      const content = await draw({ id: scene.id, kind: kind.value, runs: runs.keys.join(",") }, onFrame, stopped.signal);
      const file = URL.createObjectURL(new Blob([content], { type: types[kind.value] }));
      const name = `${scene.id.replaceAll(/[^A-Za-z0-9.-]+/g, "_")}.${kind.value}`;
      const link = make("a", { href: file, download: name, class: "button primary" }, "Save the file");
      fill(said, `${plural(Math.round(content.length / 1000), "kB").replace("kBs", "kB")} `, link);
      link.focus();
    } catch (error) {
      if (error.name === "AbortError") return;
      said.className = "said bad";
      said.textContent = error.message;
    }
  });
  dialog.addEventListener("close", () => stopped.abort(), { once: true });
  fill(dialog, form);
  dialog.showModal();
  kind.focus();
}

// Read lines of progress and then the file; see clips.py.
async function draw(parameters, onFrame, signal) {
  const response = await fetch(`/api/clip?${new URLSearchParams(parameters)}`, { signal });
  if (!response.ok) throw new Error((await response.json()).error);
  const reader = response.body.getReader();
  let rest = new Uint8Array(0);
  let size = null;
  for (;;) {
    for (let end; size === null && (end = rest.indexOf(10)) >= 0; rest = rest.subarray(end + 1)) {
      const message = JSON.parse(new TextDecoder().decode(rest.subarray(0, end)));
      if (message.error) throw new Error(message.error);
      if ("size" in message) size = message.size;
      else onFrame(message);
    }
    const { done, value } = await reader.read();
    if (done) break;
    rest = joined(rest, value);
  }
  if (rest.length !== size) throw new Error("the clip is incomplete; is `scenarionet browse` still running?");
  return rest;
}

function joined(first, second) {
  const both = new Uint8Array(first.length + second.length);
  both.set(first);
  both.set(second, first.length);
  return both;
}
