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

// Limits around values that are multiples of 1, 2 or 5 times a power of ten.
export function rounded(least, most) {
  const rough = (most - least) / 4 || 1;
  const power = 10 ** Math.floor(Math.log10(rough));
  const unit = power * [1, 2, 5, 10].find((factor) => factor * power >= rough);
  return [Math.floor(least / unit + 1e-9) * unit, Math.ceil(most / unit - 1e-9) * unit];
}

// Readable name of a type: TRAFFIC_CONE -> traffic cone.
export function words(name) {
  return name ? name.toLowerCase().replaceAll("_", " ") : "unknown";
}
