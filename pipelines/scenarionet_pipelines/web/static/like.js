// More like this: the scenarios that are nearest to the shown one by an embedding of the lake.

import * as address from "/static/address.js";
import { fill, make } from "/static/elements.js";
import { number } from "/static/format.js";
import { getJson } from "/static/server.js";

// A folded list, which is asked for when it is unfolded.
export function moreLike(lake, id) {
  const list = make("div", { class: "like", "aria-live": "polite" });
  const asked = make("details", { class: "more-like" }, make("summary", {}, "More like this"), list);
  asked.addEventListener("toggle", () => { if (asked.open && !list.childElementCount) show(lake, id, list); });
  return asked;
}

async function show(lake, id, list) {
  fill(list, make("p", {}, "Searching…"));
  let found;
  try {
    found = await getJson("/api/similar", { id });
  } catch (error) {
    fill(list, make("p", { class: "problem", role: "alert" }, error.message));
    return;
  }
  if (!found.by) {
    fill(list, make("p", {}, "No embedding yet. Write one with ", make("code", {}, "scenarionet db embed"), "."));
    return;
  }
  const items = found.similar.map(({ scenario_id, distance }) => {
    const picture = make("img", { alt: "", width: 128, height: 80, loading: "lazy", src: `/api/thumbnail?${new URLSearchParams({ id: scenario_id, width: 256, height: 160, snapshot: lake.snapshot })}` });
    const href = address.href({ ...address.read(), ...address.elsewhere, scenario: scenario_id });
    return make("li", {}, make("a", { href }, picture, make("span", {}, scenario_id)), make("small", {}, `distance ${number(distance)}`));
  });
  fill(list, make("p", {}, `The nearest by ${found.by}.`), make("ul", {}, ...items));
}
