// How numbers and times look, as in trdlab/formatting.py and trdlab/explanations/words.py.

import { isSame } from "./solver.js";

const SMALLEST_FIXED = 1e-4, LARGEST_FIXED = 1e7;

const bare = (text) => (text.includes(".") ? text.replace(/0+$/, "").replace(/\.$/, "") : text);
const power = (value) => Number(value.toExponential().split("e")[1]); // of ten, of its first digit

/** Returns a number with fixed decimals, a half rounded to the even side. */
function fixed(value, decimals) {
  const text = value.toFixed(decimals), long = value.toFixed(100), point = long.indexOf(".");
  const isHalf = /^50*$/.test(long.slice(point + 1 + decimals));
  const down = long.slice(0, point + (decimals && decimals + 1));
  return isHalf && "02468".includes(down.at(-1)) ? down : text;
}

/** Returns a number as sentences say it: significant digits, without zeros at their end. */
export function said(value, digits = 3) {
  if (value === 0 || !Number.isFinite(value)) return value === 0 ? "0" : Number.isNaN(value) ? "none" : `${value < 0 ? "-" : ""}inf`;
  if (Math.abs(value) < SMALLEST_FIXED || Math.abs(value) >= LARGEST_FIXED) {
    const [mantissa, exponent] = value.toExponential(digits - 1).split("e");
    return `${bare(mantissa)}e${exponent[0]}${exponent.slice(1).padStart(2, "0")}`;
  }
  return bare(fixed(value, Math.max(0, digits - 1 - power(value))));
}

/** Returns the significant digits at which different numbers look different. */
export function digitsToTell(values) {
  const told = values.filter((value, i) => !values.slice(0, i).some((other) => isSame(value, other)));
  for (let digits = 3; digits < 15; digits++) {
    if (new Set(told.map((value) => said(value, digits))).size === told.length) return digits;
  }
  return told.length > 1 ? 15 : 3;
}

/** Returns a given number, such as γ, with as many digits as it needs. */
export const plain = (value) => String(Number(value.toPrecision(12)));

/** Returns a share in percent; what is neither nothing nor all does not look like it. */
export function percent(share) {
  for (let decimals = 0; ; decimals++) {
    const text = fixed(100 * share, decimals);
    if (decimals === 4 || share === 0 || share === 1 || ![0, 100].includes(Number(text))) return text;
  }
}

/** Returns a list as people say it. */
export const joined = (parts) => (parts.length === 1 ? parts[0] : `${parts.slice(0, -1).join(", ")} and ${parts.at(-1)}`);

export const counted = (count, noun) => `${count.toLocaleString("en-US")} ${noun}${count === 1 ? "" : "s"}`;
export const firstSteps = (count) => (count === 1 ? "the first step" : `the first ${count.toLocaleString("en-US")} steps`);

/** Returns when component i of N + 1 comes, counted from the action, as people say it. */
export function whenOf(i, horizon, width) {
  const start = i * width, end = start + width - 1;
  if (i === horizon) return start ? `after ${firstSteps(start)}` : "at any time";
  if (width === 1) return start ? `${counted(start, "step")} later` : "at once";
  return start ? `${start} to ${end} steps later` : `in ${firstSteps(width)}`;
}

/** Returns the short name of component i, for axes and tables: t, t+1, t+2…t+3, t+4…∞. */
export function labelOf(i, horizon, width) {
  const at = (step) => (step ? `t+${step}` : "t"), start = i * width;
  if (i === horizon) return `${at(start)}…∞`;
  return width === 1 ? at(start) : `${at(start)}…${at(start + width - 1)}`;
}

/** Returns what a sentence says, its numbers with as many digits as tell them apart. */
export function sentence(strings, ...slots) {
  const digits = digitsToTell(slots.filter((slot) => slot.show).map((slot) => slot.value));
  const text = strings.map((part, i) => part + (i < slots.length ? (slots[i].show?.(digits) ?? slots[i]) : "")).join("");
  return text[0].toUpperCase() + text.slice(1);
}

const does = (gives, costs) => (x) => ({
  value: Math.abs(x),
  show: (digits) => (x === 0 ? `${gives} nothing` : `${x > 0 ? gives : costs} ${said(Math.abs(x), digits)}`),
});
export const gives = does("gives", "costs");
export const gains = does("gains", "loses");
export const number = (x) => ({ value: x, show: (digits) => said(x, digits) });
export const size = (x) => ({ value: Math.abs(x), show: (digits) => (x ? said(x, digits) : "nothing") });
