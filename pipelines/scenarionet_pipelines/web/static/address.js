// The state of the page, stored in its address so that it can be reloaded, bookmarked and shared.

const defaults = {
  where: "",
  database: "",
  run: "",
  moments: "",
  sort: "scenario_id",
  order: "rising",
  page: 1,
  rows: 50,
  columns: "dataset,split,duration,ego_distance,ego_mean_speed,num_objects,num_lanes,difficulty",
  scenario: "",
  at: "",
  object: "",
  follow: "",
  runs: "",
  look: "",
  camera: "",
  view: "",
  charts: "",
  ranges: "",
};

// What belongs to one scenario: the time [s], the selected object and whether the view follows it.
// The runs beside it, the camera and whether it is seen in space stay when the next scenario is opened.
export const elsewhere = { at: "", object: "", follow: "" };

export function read() {
  const given = new URLSearchParams(location.search);
  const state = { ...defaults };
  for (const name of Object.keys(defaults)) if (given.has(name)) state[name] = given.get(name);
  state.page = Math.max(1, Number.parseInt(state.page, 10) || 1);
  state.rows = Math.min(200, Math.max(1, Number.parseInt(state.rows, 10) || defaults.rows));
  return state;
}

export function href(state) {
  const shown = Object.entries(state).filter(([name, value]) => String(value) !== String(defaults[name]));
  const query = new URLSearchParams(shown).toString();
  return query ? `/?${query}` : "/";
}

export function write(state) {
  if (href(state) !== location.pathname + location.search) history.pushState(null, "", href(state));
}

// Change the address without a new entry in the history.
export function replace(changes) {
  history.replaceState(null, "", href({ ...read(), ...changes }));
}
