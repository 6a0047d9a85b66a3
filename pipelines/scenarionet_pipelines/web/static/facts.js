// Properties of objects, map features and scenarios, for the tooltip and the side panel.

import { make } from "/static/elements.js";
import { cell, number, words } from "/static/format.js";

const degrees = 180 / Math.PI;

// Properties of an object at a timestep.
export function objectFacts(scene, row, step) {
  const object = scene.objects[row];
  const at = row * scene.numSteps + step;
  const isThere = scene.isThere(row, step);
  const [first, last] = scene.span(row);
  const size = [...scene.size.subarray(3 * row, 3 * row + 3)].map((side) => side.toFixed(1)).join(" × ");
  const marks = [row === scene.ego ? "ego" : "", object.interesting ? "of interest" : "", object.predicted ? "to predict" : ""].filter(Boolean);
  return {
    title: scene.names[row],
    terms: [
      ["id", object.id],
      ["type", words(object.type) + (object.source ? ` (${object.source})` : "")],
      ["marked", marks.join(", ")],
      ["speed", isThere ? `${scene.speed(row, step).toFixed(1)} m/s` : "not visible now"],
      ["heading", isThere ? `${(scene.heading[at] * degrees).toFixed(0)}°` : ""],
      ["position", isThere ? `${scene.position[2 * at].toFixed(1)}, ${scene.position[2 * at + 1].toFixed(1)} m` : ""],
      ["size", `${size} m`],
      ["visible", first < 0 ? "never" : `${scene.time[first].toFixed(1)} – ${scene.time[last].toFixed(1)} s`],
    ],
  };
}

// Properties of a map feature.
export function featureFacts(scene, row) {
  const { id, type, limit } = scene.features[row];
  return { title: id, terms: [["type", words(type)], ["speed limit", limit === null ? "" : `${number(limit)} m/s`]] };
}

// Build elements from properties; empty ones are left out.
export function described({ title, terms }) {
  const rows = terms.filter(([, value]) => value !== "").flatMap(([term, value]) => [make("dt", {}, term), make("dd", {}, value)]);
  return [make("strong", {}, title), make("dl", {}, ...rows)];
}

// A scenario's row of metadata, with units.
export function scenarioFacts(lake, facts) {
  const units = Object.fromEntries(lake.columns.map((column) => [column.name, column]));
  const shown = Object.entries(facts).filter(([, value]) => value !== null && value !== "" && !(Array.isArray(value) && !value.length));
  const rows = shown.flatMap(([name, value]) => {
    const unit = units[name]?.unit;
    const text = Array.isArray(value) && value.length > 12 ? `${value.length} values` : cell(value);
    return [make("dt", { title: units[name]?.doc ?? "" }, name), make("dd", {}, unit ? `${text} ${unit}` : text)];
  });
  return make("dl", { class: "facts" }, ...rows);
}
