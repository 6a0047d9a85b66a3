// Events of the recording, asked for one kind at a time, so that the first appear soon.

import { getJson } from "/static/server.js";

let kinds = [];

export function startEvents(lake) {
  kinds = lake.events;
}

// Call `onFound` with the events of each kind; returns what stops the search.
export function events(scene, onFound) {
  const search = new AbortController();
  find(scene, onFound, search.signal);
  return search;
}

async function find(scene, onFound, signal) {
  for (const event of kinds) {
    let rows;
    try {
      rows = await getJson("/api/events", { id: scene.id, event }, signal);
    } catch (error) {
      if (error.name === "AbortError") return;
      console.info(`events of the kind ${event} are not shown: ${error.message}`);
      continue;
    }
    if (signal.aborted) return;
    const time = (step) => scene.time[Math.min(step, scene.numSteps - 1)];
    if (rows.length) onFound(rows.map((row) => ({ kind: event, first: time(row.first_timestep), last: time(row.last_timestep), track: row.track_id, other: row.other_id })));
  }
}
