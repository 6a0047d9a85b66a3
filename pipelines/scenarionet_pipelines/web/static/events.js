// Events of the recording, asked for one kind at a time, so that the first appear soon.

import { words } from "/static/format.js";
import { getJson } from "/static/server.js";

const deeds = {
  crash: "hits", cut_in: "cuts in before", following: "follows", hard_acceleration: "accelerates hard", hard_braking: "brakes hard",
  jaywalking: "crosses off the crosswalk", lane_change: "changes lane", near_miss: "nearly hits", off_road: "is off the road",
  out_of_road: "leaves the road", overtaking: "overtakes", pedestrian_crossing: "crosses before", post_encroachment_time: "crosses the path of",
  red_light_running: "runs a red light", stationary_lead: "is behind the standing", stop_at_red: "waits at red", success: "arrives",
  time_to_collision: "is on collision course with", timeout: "is out of time", turn_left: "turns left", turn_right: "turns right",
  u_turn: "turns around", unprotected_left: "turns left before",
};

let kinds = [];

export function startEvents(lake) {
  kinds = lake.events;
}

// What happens, in words: "vehicle 2 overtakes ego"; the ego is not named as the one who acts.
export function told({ kind, track, other, isMoment }, scene) {
  const [who, whom] = [track, other].map((id) => scene.names[scene.objects.findIndex((object) => object.id === id)]);
  if (isMoment) return [words(kind), who && `actor ${who}`, whom && `other ${whom}`].filter(Boolean).join(" · ");
  return [who === "ego" ? null : who, deeds[kind] ?? words(kind), whom].filter(Boolean).join(" ");
}

// Call `onFound` with the events of each kind; returns what stops the search.
export function events(scene, onFound) {
  const search = new AbortController();
  find(scene, onFound, search.signal);
  return search;
}

// The kept moments of a scenario by the name under which they are kept: [name, moments].
export async function moments(scene, signal) {
  const rows = await getJson("/api/moments", { id: scene.id }, signal);
  const time = (step) => scene.time[Math.min(step, scene.numSteps - 1)];
  const names = [...new Set(rows.map(({ name }) => name))];
  const told = ({ definition, first_timestep, last_timestep, track_id, other_id }) => ({ kind: definition, isMoment: true, first: time(first_timestep), last: time(last_timestep), track: track_id, other: other_id });
  return names.map((name) => [name, rows.filter((row) => row.name === name).map(told)]);
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
