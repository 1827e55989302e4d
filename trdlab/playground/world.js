// Maps and their exact models. The rules are those of trdlab/gridworld: gridmap.py and world.py.

export const ACTIONS = ["up", "down", "left", "right"];
const MOVES = [[-1, 0], [1, 0], [0, -1], [0, 1]];
const SIDEWAYS = [[2, 3], [2, 3], [0, 1], [0, 1]]; // the two directions that a move slips to
const OPPOSITE = [1, 0, 3, 2];
const MOST_CELLS = 10000, MOST_WIND = 9;
const USUAL = { coin: 1, treasure: 4, hazard: -1, fountain: 1, exit: 0 }; // what each kind pays
const NUMBER = /^[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?$/i;

const cell = (kind, value = 0, terminal = false, arrow = null) => ({ kind, value, terminal, arrow });

/** What each letter means; coins and treasures pay once, hazards and fountains each time. */
export const LEGEND = new Map([
  ["S", cell("floor")], [".", cell("floor")], ["#", cell("wall")],
  ["c", cell("coin", 1)], ["C", cell("coin", 1, true)],
  ["t", cell("treasure", 4)], ["T", cell("treasure", 4, true)],
  ["h", cell("hazard", -1)], ["H", cell("hazard", -1, true)],
  ["f", cell("fountain", 1)], ["E", cell("exit", 0, true)],
  ...["^", "v", "<", ">"].map((letter, i) => [letter, cell("one-way", 0, false, i)]),
]);

export const pays = ({ kind }) => kind in USUAL;
export const paysOnce = ({ kind }) => kind === "coin" || kind === "treasure";

/** A map that cannot be read or played: what is wrong, and the cure. */
export class MapFault extends Error {
  constructor(cause, cure) {
    super(`${cause} ${cure}`);
    this.cure = cure;
  }
}

// ---- reading -------------------------------------------------------------------------------------

/** Returns a map as it is written: `{head, rows, legend, title, stepCost, slip, wind}`. */
export function parseMap(text) {
  const lines = text.split(/\r\n|\r|\n/).map((line) => line.trimEnd());
  const cut = lines.indexOf("---");
  const grid = { head: lines.slice(0, Math.max(0, cut)), rows: [], legend: new Map(LEGEND), title: "", stepCost: 0, slip: 0, wind: null };
  const seen = new Set();
  for (const line of grid.head) if (line.trim()) readHeader(grid, line.trim(), seen);
  const body = lines.slice(cut + 1), filled = body.flatMap((line, i) => (line ? [i] : []));
  grid.rows = body.slice(filled[0] ?? 0, (filled.at(-1) ?? -1) + 1);
  checkRows(grid);
  checkWind(grid);
  return grid;
}

/** Returns the text of a map, to be saved as a file. */
export const mapText = ({ head, rows }) => [...(head.length ? [...head, "---"] : []), ...rows, ""].join("\n");

function readHeader(grid, line, seen) {
  const rest = line.slice(1).trimStart(), colon = line.indexOf(":");
  const isLetter = rest.startsWith("=");
  const key = isLetter ? line[0] : line.slice(0, Math.max(0, colon)).trim(), value = line.slice(colon + 1).trim();
  if (!isLetter && !["title", "step_cost", "slip", "wind"].includes(key)) {
    throw new MapFault(`Cannot read the header line '${line}'.`, "Known are title, step_cost, slip and wind. A letter is defined as: X = coin 5 terminal");
  }
  if (isLetter && ["floor", "wall", "one-way"].includes(LEGEND.get(key)?.kind)) {
    throw new MapFault(`The symbol '${key}' has a fixed meaning.`, "Choose another one.");
  }
  if (seen.has(key)) throw new MapFault(`The header sets '${key}' twice.`, "Keep one of the lines.");
  seen.add(key);
  if (isLetter) grid.legend.set(key, readCell(key, rest.slice(1).trim().split(/\s+/)));
  else if (key === "title") grid.title = value;
  else if (key === "step_cost") grid.stepCost = finite(key, value);
  else if (key === "slip") grid.slip = probability(finite(key, value));
  else grid.wind = readWind(value.split(/\s+/));
}

function readCell(letter, words) {
  const [kind, value, ...more] = words.filter((word) => word !== "terminal");
  if (!(kind in USUAL) || more.length) {
    throw new MapFault(`Cannot read the symbol '${letter} = ${words.join(" ")}'.`, `Write a kind (${Object.keys(USUAL).join(", ")}), a value, and 'terminal' where it ends the episode.`);
  }
  const ends = words.includes("terminal") || kind === "exit";
  return cell(kind, value === undefined ? USUAL[kind] : finite(kind, value), ends);
}

function readWind([direction, ...strengths]) {
  if (!ACTIONS.includes(direction)) throw new MapFault(`The wind blows '${direction}'.`, `Known: ${ACTIONS.join(", ")}.`);
  if (!strengths.every((word) => /^\d+$/.test(word) && Number(word) <= MOST_WIND)) {
    throw new MapFault(`Cannot read the wind strengths '${strengths.join(" ")}'.`, `Write a whole number from 0 to ${MOST_WIND} for each column (or row).`);
  }
  return { direction: ACTIONS.indexOf(direction), strengths: strengths.map(Number) };
}

function checkRows({ rows, legend }) {
  if (!rows.length) throw new MapFault("The map is empty.", "Draw at least a start S and a neighbour.");
  const longest = Math.max(...rows.map((row) => row.length));
  if (rows.length * longest > MOST_CELLS) {
    throw new MapFault(`The map has ${rows.length} rows of up to ${longest} cells.`, `A map may have ${MOST_CELLS} cells.`);
  }
  rows.forEach((row, i) => {
    if (row.length !== rows[0].length) {
      throw new MapFault(`Row ${i} of the map has ${row.length} cells, row 0 has ${rows[0].length}.`, "Make all rows equally long; fill with '#' (wall) or '.' (floor).");
    }
    const unknown = [...row].find((letter) => !legend.has(letter));
    if (unknown !== undefined) {
      throw new MapFault(`Unknown symbol '${unknown}' at row ${i}, column ${row.indexOf(unknown)} of the map.`, `Known symbols: ${[...legend.keys()].join(" ")}. Define more in the header: ${unknown} = coin 5`);
    }
  });
  const starts = rows.join("").split("S").length - 1;
  if (starts !== 1) throw new MapFault(`The map has ${starts || "no"} start${starts ? "s" : ""}.`, "Mark exactly one cell with S.");
}

function checkWind({ rows, wind }) {
  if (!wind) return;
  const isVertical = wind.direction < 2, needed = isVertical ? rows[0].length : rows.length;
  if (wind.strengths.length !== needed) {
    throw new MapFault(`The wind has ${wind.strengths.length} strengths.`, `Blowing ${ACTIONS[wind.direction]} it needs one for each of the ${needed} ${isVertical ? "columns" : "rows"}.`);
  }
}

function finite(name, text) {
  const value = NUMBER.test(text) ? Number(text) : NaN;
  if (!Number.isFinite(value)) throw new MapFault(`The value of ${name} is '${text}'.`, "It must be a finite number.");
  return value;
}

function probability(value) {
  if (value < 0 || value > 1) throw new MapFault(`The slip probability is ${value}.`, "It must lie between 0 and 1.");
  return value;
}

/** Returns a map with another slip, or with all treasures paying another value; null changes nothing. */
export function changed(grid, { slip = null, treasure = null }) {
  const pay = (of) => (of.kind === "treasure" ? { ...of, value: treasure } : of);
  const legend = treasure === null ? grid.legend : new Map([...grid.legend].map(([letter, of]) => [letter, pay(of)]));
  return { ...grid, legend, slip: slip === null ? grid.slip : probability(slip) };
}

/** Returns what treasures pay on a map: one value, or null where there is none or they differ. */
export function treasureOf({ rows, legend }) {
  const values = new Set([...rows.join("")].map((letter) => legend.get(letter)).filter(({ kind }) => kind === "treasure").map(({ value }) => value));
  return values.size === 1 ? [...values][0] : null;
}

// ---- the exact model -----------------------------------------------------------------------------

/**
 * Returns the exact model of a map: states in the order in which a breadth-first search meets them,
 * and for each action `row = 4 * state + action` its outcomes from `offsets[row]` on.
 */
export function buildWorld(grid, mostStates = 5000) {
  const { rows, legend } = grid, [height, width] = [rows.length, rows[0].length];
  const at = (row, column) => (row >= 0 && row < height && column >= 0 && column < width ? legend.get(rows[row][column]) : LEGEND.get("#"));
  const startRow = rows.findIndex((row) => row.includes("S"));
  const states = [], index = new Map(), entered = new Set();
  const number = (row, column, collected) => {
    const key = `${row},${column};${collected.join()}`;
    if (!index.has(key)) {
      index.set(key, states.length);
      states.push({ row, column, collected });
    }
    return index.get(key);
  };

  /** Returns the next cell in a direction, or the same one where the way is barred. */
  function neighbour([row, column], direction) {
    const to = [row + MOVES[direction][0], column + MOVES[direction][1]], here = at(row, column), there = at(...to);
    const against = there.arrow !== null && OPPOSITE[there.arrow] === direction;
    const barred = there.kind === "wall" || (here.arrow !== null && here.arrow !== direction) || against;
    return barred ? [row, column] : to;
  }

  /** Returns the cells that one step enters in turn: its own move, then the wind's. */
  function path(state, direction) {
    const moves = [direction], { wind } = grid;
    if (wind) moves.push(...Array(wind.strengths[wind.direction < 2 ? state.column : state.row]).fill(wind.direction));
    const cells = [];
    let place = [state.row, state.column];
    for (const move of moves) {
      const next = neighbour(place, move);
      if (next[0] !== place[0] || next[1] !== place[1]) cells.push(next);
      place = next;
    }
    return cells;
  }

  function arrive(state, cells) {
    let { row, column, collected } = state, reward = 0 - grid.stepCost, terminated = false;
    for ([row, column] of cells) {
      const here = at(row, column), place = row * width + column;
      entered.add(place);
      if (pays(here) && !collected.includes(place)) reward += here.value;
      if (paysOnce(here) && !collected.includes(place)) collected = [...collected, place].sort((a, b) => a - b);
      terminated = here.terminal;
      if (terminated) break;
    }
    return { next: number(row, column, collected), reward, terminated };
  }

  const world = { grid, states, offsets: [0], next: [], probability: [], reward: [], terminated: [], over: [] };
  const put = (found) => {
    for (const name of ["next", "probability", "reward", "terminated"]) world[name].push(found[name]);
  };
  number(startRow, rows[startRow].indexOf("S"), []);
  entered.add(states[0].row * width + states[0].column);
  for (let s = 0; s < states.length; s++) { // it grows while its successors are added
    if (states.length > mostStates) {
      throw new MapFault(`The map has more than ${mostStates} states: each coin that can be taken or not doubles them.`, "Use fewer coins and treasures, or fountains; the command trdlab gridworld solves ten times as many.");
    }
    const isOver = at(states[s].row, states[s].column).terminal;
    world.over.push(isOver);
    for (let a = 0; a < 4; a++) {
      const outcomes = new Map();
      const ways = isOver ? [] : [[a, 1 - grid.slip], ...SIDEWAYS[a].map((way) => [way, grid.slip / 2])];
      if (isOver) put({ next: s, probability: 1, reward: 0, terminated: true });
      for (const [way, chance] of ways.filter(([, p]) => p > 0)) {
        const found = arrive(states[s], path(states[s], way)), key = JSON.stringify(found);
        outcomes.set(key, { ...found, probability: (outcomes.get(key)?.probability ?? 0) + chance });
      }
      for (const found of outcomes.values()) put(found);
      world.offsets.push(world.next.length);
    }
  }
  checkReachable(world, entered);
  return world;
}

function checkReachable({ grid: { rows, legend } }, entered) {
  rows.forEach((line, row) => [...line].forEach((letter, column) => {
    const { kind } = legend.get(letter);
    if (["coin", "treasure", "fountain", "exit"].includes(kind) && !entered.has(row * line.length + column)) {
      throw new MapFault(`The ${kind} at row ${row}, column ${column} cannot be reached from the start.`, "Open a way to it, or remove it.");
    }
  }));
  if (entered.size === 1) throw new MapFault("The start is walled in.", "Open a way out of it.");
}

/** Returns the number of a state `row,column` or `row,column,collected`, with least collected; or -1. */
export function findState({ states }, text) {
  const [row, column, count = null] = text.split(",").map(Number);
  const found = states.map((state, s) => [state.collected.length, s]).filter(([taken, s]) => (
    states[s].row === row && states[s].column === column && (count === null || taken === count)
  ));
  return found.length ? found.sort((a, b) => a[0] - b[0] || a[1] - b[1])[0][1] : -1;
}

/** Returns for each place the state that is shown there: with the same collected as in another one, or else the first. */
export function statesLike({ grid, states }, { collected }) {
  const found = new Map(), width = grid.rows[0].length;
  states.forEach((state, s) => {
    const place = state.row * width + state.column;
    if (!found.has(place) || state.collected.join() === collected.join()) found.set(place, s);
  });
  return found;
}
