// The pictures: the map, bars stacked over time, the contrast, and the table that is their twin.

import { ACTIONS, pays, paysOnce } from "./world.js";
import { labelOf, plain, said } from "./numbers.js";
import { sum } from "./solver.js";

const DEGREES = [-90, 90, 180, 0]; // of up, down, left and right, clockwise from the right
const ARROWS = ["↑", "↓", "←", "→"];
const UNSAID = { coin: 1, fountain: 1, exit: 0 }; // the values that go without saying

export function el(name, properties = {}, ...children) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(properties)) {
    if (key in made) made[key] = value;
    else made.setAttribute(key, value);
  }
  made.append(...children);
  return made;
}

const shown = (value, digits = 3) => said(value, digits).replace(/^-/, "−");

export function svg(name, attributes = {}, ...children) {
  const made = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  made.append(...children);
  return made;
}

// ---- the map -------------------------------------------------------------------------------------

/** Returns the symbols of all icons, to be put once into a page. */
export function symbols(icons) {
  const parts = Object.entries(icons).map(([name, shapes]) => (
    svg("symbol", { id: `i-${name}`, viewBox: "-.5 -.5 1 1" }, ...shapes.map(([d, fill]) => svg("path", { d, fill })))
  ));
  return svg("svg", { class: "symbols", "aria-hidden": "true" }, ...parts);
}

const use = (name, more = {}) => svg("use", { href: `#i-${name}`, x: -0.5, y: -0.5, width: 1, height: 1, ...more });
const turned = (name, action, more = "") => use(name, { transform: `${more} rotate(${DEGREES[action]})` });

/** Returns the picture of a cell: what stands there, what is left of it, and the drone. */
export function cellPicture(cell, { isStart = false, isTaken = false, hasDrone = false, wind = null } = {}) {
  const parts = [];
  if (cell.kind === "wall") parts.push(use("wall"));
  if (cell.terminal) parts.push(use("frame"));
  else if (wind?.strength && cell.kind !== "wall") {
    const corner = cell.kind === "floor" ? "" : "translate(-.32 -.33) scale(.5)";
    parts.push(turned(`wind-${wind.strength}`, wind.direction, corner));
  }
  if (isStart) parts.push(use("start"));
  if (cell.arrow !== null) parts.push(turned("one-way", cell.arrow));
  if (isTaken && !hasDrone) parts.push(use(`${cell.kind}-taken`));
  if (pays(cell) && !isTaken) {
    const isTold = cell.value !== UNSAID[cell.kind];
    parts.push(use(cell.kind, isTold && cell.kind !== "coin" ? { transform: "translate(0 -.1) scale(.9)" } : {}));
    if (isTold) parts.push(svg("text", { y: cell.kind === "coin" ? 0.07 : 0.38 }, plain(cell.value).replace("-", "−")));
  }
  if (hasDrone) parts.push(use("drone"));
  return svg("svg", { viewBox: "-.5 -.5 1 1", "aria-hidden": "true" }, ...parts);
}

/** Returns what a cell is called: coin of 1, ends the episode. */
export function cellName(cell) {
  if (cell.arrow !== null) return `one way ${ACTIONS[cell.arrow]}`;
  if (!pays(cell)) return cell.kind;
  return `${cell.kind} of ${plain(cell.value)}${cell.terminal ? ", ends the episode" : ""}`;
}

/** Returns the tools that a click on the map can use: to choose a state, or to draw a letter. */
export function toolButtons(legend, chosen) {
  const button = (letter, label, name, picture) => el("label", { className: "tool", title: name }, el("input", { type: "radio", name: "tool", value: letter, checked: letter === chosen, "aria-label": name }), picture, label);
  const letters = [...legend].map(([letter, cell]) => {
    const isStart = letter === "S", label = isStart ? "start" : cellName(cell).replace("floor", "empty");
    return button(letter, label.replace("the episode", "").replace(" of ", " "), `${label}, letter ${letter}`, cellPicture(cell, { isStart }));
  });
  return [button("drone", "choose", "choose the state that is explained", cellPicture(legend.get("."), { hasDrone: true })), ...letters];
}

/**
 * Fills the grid of a map.
 *
 * @param box the grid element; its cells are kept if the shape stays, and with them the focus.
 * @param view `{grid, drone, stateAt, values, policy, news, over}`: the map, the drone's state, the
 *   number of the state shown at each place, and what is known of it.
 */
export function drawMap(box, { grid, drone, stateAt, values, policy, news, over }) {
  const { rows, legend, wind } = grid, width = rows[0].length;
  if (box.dataset.shape !== `${rows.length},${width}`) {
    box.dataset.shape = `${rows.length},${width}`;
    box.style.setProperty("--columns", width);
    box.classList.toggle("many", width > 8);
    box.replaceChildren(...rows.map((line, row) => el("div", { role: "row" }, ...[...line].map((_, column) => (
      el("div", { role: "gridcell", className: "cell", tabIndex: row + column ? -1 : 0, "data-row": row, "data-column": column })
    )))));
  }
  for (const tile of box.querySelectorAll(".cell")) {
    const row = Number(tile.dataset.row), column = Number(tile.dataset.column), place = row * width + column;
    const cell = legend.get(rows[row][column]), s = stateAt.get(place), isHere = drone?.row === row && drone?.column === column;
    const isTaken = !!drone && paysOnce(cell) && drone.collected.includes(place), isStart = rows[row][column] === "S";
    const strength = wind ? wind.strengths[wind.direction < 2 ? column : row] : 0;
    const look = { isStart, isTaken, hasDrone: isHere, wind: wind && { direction: wind.direction, strength } }, key = JSON.stringify([cell, look]);
    if (tile.dataset.key !== key) tile.replaceChildren(cellPicture(cell, look), el("span", { className: "worth" }));
    tile.dataset.key = key;
    const isWorth = s !== undefined && !over[s], worth = tile.lastChild;
    worth.hidden = !isWorth;
    let told = `row ${row}, column ${column}: ${isStart ? "start, " : ""}${cellName(cell)}${isTaken ? ", taken" : ""}`;
    if (isWorth) {
      worth.replaceChildren(ARROWS[policy[s]], el("span", {}, ` ${shown(values[s], 2)}`));
      told += `; worth ${said(values[s], 3)}, best is ${ACTIONS[policy[s]]}`;
    }
    tile.classList.toggle("here", isHere);
    tile.classList.toggle("news", s !== undefined && news.has(s));
    tile.setAttribute("aria-selected", String(isHere));
    tile.setAttribute("aria-label", told + (isHere ? "; the drone is here" : ""));
  }
}

// ---- bars ----------------------------------------------------------------------------------------

/** How strongly a component is painted: what comes soon is darkest, the residual is hatched. */
const shade = (i, horizon) => (i === horizon ? 0.45 : 1 - (0.68 * i) / Math.max(1, horizon - 1));

function segment(i, horizon, { x, y, width, height, kind, fresh, title }) {
  const place = { x, y, width: Math.max(0, width), height };
  const parts = [svg("rect", { ...place, class: kind, "fill-opacity": shade(i, horizon) }, svg("title", {}, title))];
  if (i === horizon) parts.push(svg("rect", { ...place, fill: "url(#hatch)", "pointer-events": "none" }));
  parts.push(svg("rect", { ...place, class: fresh ? "fresh" : "edge", "pointer-events": "none" }));
  return parts;
}

/** Returns round numbers between two ends, 0 among them. */
function ticks(low, high, most) {
  const rough = (high - low) / most, ten = 10 ** Math.floor(Math.log10(rough));
  const unit = [1, 2, 2.5, 5, 10].map((k) => k * ten).find((u) => u >= rough * 0.999);
  const found = [];
  for (let k = Math.ceil(low / unit - 1e-9); k * unit <= high * (1 + 1e-9) + 1e-300; k++) found.push(k * unit);
  return found;
}

const hatching = () => svg("defs", {}, svg("pattern", { id: "hatch", width: 7, height: 7, patternUnits: "userSpaceOnUse", patternTransform: "rotate(45)" }, svg("line", { class: "hatch", x1: 0, y1: 0, x2: 0, y2: 7 })));
const kindOf = (a, { action, foil }) => (a === action ? "a-one" : a === foil ? "a-other" : "a-none");

/** Draws for each action a bar of its components: rewards to the right of zero, costs to the left. */
export function drawBars(box, { vectors, choice, axis, news }) {
  const width = Math.max(220, box.clientWidth), { horizon } = axis, told = vectors.map((row) => shown(sum(row)));
  const left = 52, right = 14 + 8 * Math.max(...told.map((text) => text.length)), step = 34, top = 4;
  const ends = vectors.map((row) => [sum(row.filter((x) => x < 0)), sum(row.filter((x) => x > 0))]);
  const low = Math.min(0, ...ends.map(([x]) => x)), high = Math.max(...ends.map(([, x]) => x), low < 0 ? 0 : 1e-12);
  const height = top + 4 * step + 22, x = (value) => left + ((value - low) / (high - low)) * (width - left - right);
  const canvas = svg("svg", { viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": "A bar for each action, cut where one component ends and the next begins. The table has the numbers." }, hatching());
  for (const value of high - low > 1e-9 ? ticks(low, high, width > 420 ? 5 : 3) : [0]) {
    canvas.append(svg("line", { class: value === 0 ? "zero" : "grid-line", x1: x(value), x2: x(value), y1: 0, y2: top + 4 * step }));
    canvas.append(svg("text", { x: x(value), y: height - 4, "text-anchor": "middle" }, shown(value)));
  }
  vectors.forEach((row, a) => {
    const y = top + a * step, kind = kindOf(a, choice), at = [0, 0];
    canvas.append(svg("text", { class: kind === "a-none" ? "" : "strong", x: left - 8, y: y + 21, "text-anchor": "end" }, ACTIONS[a]));
    row.forEach((value, i) => {
      if (!value) return;
      const side = value > 0 ? 1 : 0, from = at[side];
      at[side] += value;
      const [begin, end] = [x(from), x(at[side])].sort((p, q) => p - q), title = `${ACTIONS[a]}, ${labelOf(i, horizon, axis.width)}: ${shown(value, 4)}`;
      canvas.append(...segment(i, horizon, { x: begin, y: y + 4, width: end - begin, height: step - 10, kind, title, fresh: news?.has(`${a},${i}`) }));
    });
    canvas.append(svg("text", { class: kind === "a-none" ? "" : "strong", x: x(at[1]) + 6, y: y + 21 }, told[a]));
  });
  box.replaceChildren(canvas);
}

/** Draws the contrast: up speaks for the action, down for its foil. */
export function drawContrast(box, { row, axis, names }) {
  const width = Math.max(220, box.clientWidth), top = 18, bottom = 138, { horizon } = axis, left = 8;
  const low = Math.min(0, ...row), high = Math.max(0, ...row), span = high - low || 1, gap = horizon ? 0.4 : 0;
  const each = Math.min(90, (width - left) / (row.length + gap)), x = (i) => left + each * (i + (i === horizon ? gap : 0));
  const y = (value) => (high === low ? bottom : top + ((high - value) / span) * (bottom - top - (low < 0 ? 14 : 0)));
  const canvas = svg("svg", { viewBox: `0 0 ${width} 166`, role: "img", "aria-label": `Bars of ${names[0]} minus ${names[1]}, one for each component. The last row of the table has the numbers.` }, hatching());
  canvas.append(svg("line", { class: "zero", x1: 0, x2: width, y1: y(0), y2: y(0) }));
  const every = Math.ceil(46 / each);
  row.forEach((value, i) => {
    const thick = each * 0.72, at = x(i) + (each - thick) / 2, [from, to] = [y(Math.max(0, value)), y(Math.min(0, value))];
    const label = labelOf(i, horizon, axis.width), middle = at + thick / 2;
    if (value) canvas.append(...segment(i, horizon, { x: at, y: from, width: thick, height: to - from, kind: value > 0 ? "a-one" : "a-other", title: `${label}: ${shown(value, 4)}` }));
    const told = shown(value, each > 48 ? 3 : 2);
    if (7.5 * told.length < each) canvas.append(svg("text", { class: "strong", x: middle, y: value < 0 ? to + 13 : from - 4, "text-anchor": "middle" }, told));
    const isShown = i === horizon || (i % every === 0 && x(horizon) - x(i) > 44);
    if (isShown) canvas.append(svg("text", { x: Math.min(middle, width - 4 * label.length), y: 162, "text-anchor": "middle" }, each > 62 || axis.width === 1 ? label : label.split("…")[0]));
  });
  box.replaceChildren(canvas);
}

/** Says what the shades mean: what comes now, later, and after all explicit steps. */
export function drawLegend(box, { axis: { horizon, width } }) {
  const shown = horizon > 4 ? [0, Math.floor((horizon - 1) / 2), horizon - 1, horizon] : [...Array(horizon + 1).keys()];
  box.replaceChildren(...shown.map((i) => el("span", {}, svg("svg", { viewBox: "0 0 18 12" }, hatching(), ...segment(i, horizon, { x: 0, y: 0, width: 18, height: 12, kind: "a-none", title: "" })), labelOf(i, horizon, width))));
}

// ---- the table -----------------------------------------------------------------------------------

/** Fills the table: a row for each action, and one for what the chosen two differ by. */
export function drawTable(table, { vectors, contrast, totals, choice, axis }) {
  const { horizon, width } = axis, cells = (values) => values.map((value) => el("td", {}, shown(value, 4)));
  const heads = ["action", ...vectors[0].map((_, i) => labelOf(i, horizon, width)), "Q", ...(totals ? ["total"] : [])];
  table.tHead.replaceChildren(el("tr", {}, ...heads.map((text) => el("th", { scope: "col" }, text))));
  const rows = vectors.map((row, a) => el("tr", { className: kindOf(a, choice).slice(2) }, el("th", { scope: "row" }, ACTIONS[a]), ...cells([...row, sum(row), ...(totals ? [totals[a]] : [])])));
  if (contrast) {
    const { action, foil } = choice, apart = totals ? [totals[action] - totals[foil]] : [];
    rows.push(el("tr", { className: "contrast" }, el("th", { scope: "row" }, `${ACTIONS[action]} − ${ACTIONS[foil]}`), ...cells([...contrast, sum(contrast), ...apart])));
  }
  table.tBodies[0].replaceChildren(...rows);
}
