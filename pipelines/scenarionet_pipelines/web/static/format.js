// Formatting of values.

const whole = new Intl.NumberFormat("en");
const broken = new Intl.NumberFormat("en", { maximumSignificantDigits: 4 });

export function number(value) {
  return Number.isInteger(value) ? whole.format(value) : broken.format(value);
}

export function cell(value) {
  if (value === null || value === undefined || value === "") return "–";
  if (typeof value === "number") return number(value);
  if (typeof value === "boolean") return value ? "yes" : "no";
  if (Array.isArray(value)) return value.map(cell).join(", ") || "–";
  return String(value);
}

export function plural(count, noun) {
  return `${whole.format(count)} ${noun}${count === 1 ? "" : "s"}`;
}

// Readable name of a type: TRAFFIC_CONE -> traffic cone.
export function words(name) {
  return name ? name.toLowerCase().replaceAll("_", " ") : "unknown";
}
