// What is chosen, as the address of the page and as a command of trdlab has it.

import { ACTIONS } from "./world.js";
import { plain } from "./numbers.js";

/** What is chosen where nothing else is: the map, the settings, and what is looked at. */
export const DEFAULTS = { map: "drone", text: null, gamma: 0.95, N: 4, w: 1, slip: null, treasure: null, state: null, action: null, foil: null, sweeps: null };
/** The least and the most that can be typed. */
export const LIMITS = { gamma: [0, 0.999], N: [0, 40], w: [1, 40], slip: [0, 1], treasure: [-1e6, 1e6], sweeps: [0, 1000] };
export const OWN_MAP = "my-map.txt";
const WHOLE = ["N", "w", "sweeps"];

/** Returns what stands behind the # of an address: all that is not as it is without one. */
export function toHash(now) {
  const chosen = Object.entries(now).filter(([name, value]) => value !== null && (name === "map" || value !== DEFAULTS[name]));
  return new URLSearchParams(chosen.map(([name, value]) => [name, ACTIONS[["action", "foil"].includes(name) ? value : -1] ?? value])).toString();
}

/** Returns what an address has chosen, or null where it is none of these; what makes no sense is left out. */
export function fromHash(hash, maps) {
  if (!hash.includes("=")) return null;
  const given = new URLSearchParams(hash.replace(/^#/, "")), now = { ...DEFAULTS };
  if (given.get("map") in maps) now.map = given.get("map");
  now.text = given.get("text");
  if (/^\d+,\d+(,\d+)?$/.test(given.get("state"))) now.state = given.get("state");
  for (const [name, [least, most]] of Object.entries(LIMITS)) {
    const value = Number(given.get(name) || NaN);
    if (value >= least && value <= most) now[name] = WHOLE.includes(name) ? Math.round(value) : value;
  }
  for (const name of ["action", "foil"]) {
    const a = ACTIONS.indexOf(given.get(name));
    if (a >= 0) now[name] = a;
  }
  if (now.foil === now.action) now.foil = null;
  return now;
}

/** Returns the command that prints the same numbers; a map of one's own is a file beside it. */
export function commandOf({ map, text, gamma, N, w, slip, treasure, state, action, foil }) {
  const options = { map: text === null ? map : OWN_MAP, gamma, N, w, slip, treasure, state, action: ACTIONS[action], foil: ACTIONS[foil] };
  const given = Object.entries(options).filter(([, value]) => value !== null && value !== undefined);
  return ["trdlab gridworld", ...given.map(([name, value]) => `--${name} ${typeof value === "number" ? plain(value) : value}`)].join(" ");
}
