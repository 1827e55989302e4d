// The page: what is chosen, what follows from it, and how a reader changes it.
// MAPS, ICONS, LAYOUT and STYLE are put in front by trdlab/playground/__init__.py.

import { ACTIONS, buildWorld, changed, findState, mapText, parseMap, statesLike, treasureOf } from "./world.js";
import { isSame, solved, sum } from "./solver.js";
import { choose, delta, flipSentences, headline, momentOf, neverFlips, sweepWords } from "./words.js";
import { drawBars, drawContrast, drawLegend, drawMap, drawTable, el, symbols, toolButtons } from "./pictures.js";
import { DEFAULTS, LIMITS, OWN_MAP, commandOf, fromHash, toHash } from "./address.js";
import { beyond, flipsOfGamma } from "./flips.js";
import { counted, plain } from "./numbers.js";

const FIELDS = { // label, explanation, least and most of the slider, its step
  gamma: ["γ", "discount", 0, 0.999, 0.001],
  N: ["N", "components", 0, 12, 1],
  w: ["w", "steps in each", 1, 6, 1],
  slip: ["slip", "goes sideways", 0, 1, 0.01],
  treasure: ["treasure", "pays", 0, 20, 0.1],
};
const MOST_FLIP_STATES = 600, PAUSE = 200; // ms without a change, before what takes longer

class Playground extends HTMLElement {
  connectedCallback() {
    if (this.shadowRoot) return;
    const root = this.attachShadow({ mode: "open" }), style = new CSSStyleSheet();
    style.replaceSync(STYLE);
    root.adoptedStyleSheets = [style];
    root.append(symbols(ICONS), el("div", { id: "all", innerHTML: LAYOUT }));
    this.at = (id) => root.getElementById(id);
    this.past = [];
    this.tool = "drone";
    this.fill();
    this.listen();
    this.now = fromHash(location.hash, MAPS) ?? { ...DEFAULTS };
    this.update();
    new ResizeObserver(() => this.draw()).observe(this);
  }

  // ---- what follows from what is chosen ----------------------------------------------------------

  /** Works everything out anew, and shows it. */
  update() {
    const { now } = this, text = now.text ?? MAPS[now.map];
    this.at("text").value = text;
    try {
      const drawn = parseMap(text);
      this.drawn = drawn;
      if (treasureOf(drawn) === null) now.treasure = null; // there is none, or they differ
      this.grid = changed(drawn, now);
      const key = JSON.stringify({ ...now, map: text, state: 0, action: 0, foil: 0 });
      if (key !== this.key) this.solved = solved(buildWorld(this.grid), now);
      this.key = key;
      this.fault("");
    } catch (error) {
      if (!("cure" in error)) throw error;
      if (!this.solved) this.change({ text: null }); // there is nothing else to show
      this.fault(error.message);
    }
    this.draw();
    this.at("flip").classList.add("unknown");
    window.clearTimeout(this.timer);
    this.timer = window.setTimeout(() => this.later(), PAUSE);
  }

  /** Does what takes longer, once nothing changes for a moment: the flips, and the address. */
  later() {
    if (this.isChanged) history.replaceState(null, "", this.link());
    const { solved: { world }, state, choice, moment } = this;
    if (!choice) return; // nobody sees the page yet
    if (this.isFaulty || this.now.sweeps !== null || choice.foil < 0) return this.showFlips(null);
    if (world.states.length > MOST_FLIP_STATES) return this.showFlips(null, "With so many states, other discounts are not tried here.");
    this.showFlips(isSame(moment.q[choice.action], moment.q[choice.foil]) ? null : flipsOfGamma(world, this.now.gamma, state, choice.action, choice.foil));
  }

  change(what) {
    this.isChanged = true;
    Object.assign(this.now, what);
    this.update();
  }

  /** Takes a new text of the map, kept as `null` where it is one that is shipped. */
  redraw(text) {
    this.past.push({ map: this.now.map, text: this.now.text });
    const shipped = Object.keys(MAPS).find((name) => MAPS[name] === text);
    this.change(shipped ? { map: shipped, text: null } : { text });
  }

  // ---- drawing -----------------------------------------------------------------------------------

  draw() {
    const { solved, at } = this;
    if (!solved || !this.at("bars").clientWidth) return;
    this.drawFields();
    this.drawTools();
    at("undo").disabled = !this.past.length;
    at("map").value = this.now.text === null ? this.now.map : "";
    at("title").textContent = this.now.text === null ? this.drawn.title : "Your own map.";
    this.drawShare();
    if (this.isFaulty) return this.drawGrid(null);
    this.state = this.now.state === null ? 0 : findState(solved.world, this.now.state);
    if (this.state < 0) [this.state, this.now.state] = [0, null];
    this.moment = momentOf(solved, this.state);
    this.choice = choose(this.moment, this.now.action, this.now.foil);
    this.drawGrid(solved.world.states[this.state]);
    this.drawPlace();
    this.drawChoice();
    this.tell();
    this.drawNumbers();
  }

  /** Draws the map, with what is worth what: as solved, or as far as sweeps have come. */
  drawGrid(drone) {
    const { solved: { world, solution, table, before } } = this, stateAt = drone ? statesLike(world, drone) : new Map();
    const best = (of) => world.states.map((_, s) => [0, 1, 2, 3].map((a) => sum(of.map((part) => part[4 * s + a]))));
    const shown = table ? best(table) : null, last = table ? best(before) : null;
    const values = shown ? shown.map((q) => Math.max(...q)) : solution.values;
    const policy = shown ? shown.map((q) => q.indexOf(Math.max(...q))) : solution.policy;
    const news = new Set(shown ? values.flatMap((value, s) => (isSame(value, Math.max(...last[s])) ? [] : [s])) : []);
    drawMap(this.at("grid"), { grid: this.grid, drone, stateAt, values, policy, news, over: world.over });
  }

  drawPlace() {
    const { world } = this.solved, { row, column, collected } = world.states[this.state];
    const counts = [...new Set(world.states.filter((s) => s.row === row && s.column === column).map((s) => s.collected.length))].sort((a, b) => a - b);
    this.at("place").textContent = `The drone is at row ${row}, column ${column}.`;
    this.at("collected-label").hidden = counts.length < 2;
    this.at("collected").replaceChildren(...counts.map((count) => el("option", { value: count, selected: count === collected.length }, String(count))));
  }

  drawChoice() {
    const { action, foil } = this.choice, [bestOption, nextOption] = ["action", "foil"].map((id) => this.at(id).options[0]);
    const usual = choose(this.moment, null, this.now.foil), next = choose(this.moment, this.now.action, null);
    bestOption.textContent = `the best: ${ACTIONS[usual.action]}`;
    nextOption.textContent = `the next best${next.foil < 0 ? "" : `: ${ACTIONS[next.foil]}`}`;
    for (const option of this.at("foil").options) option.disabled = Number(option.value) === action && option.value !== "";
    for (const option of this.at("action").options) option.disabled = Number(option.value) === foil && option.value !== "" && this.now.foil !== null;
    this.at("action").value = this.now.action ?? "";
    this.at("foil").value = this.now.foil ?? "";
  }

  /** Says what follows: the sentences of the solution, or how far the sweeps have come. */
  tell() {
    const { moment, choice, now, solved } = this, [first, ...more] = solved.table ? sweepWords(moment, choice, solved, now.sweeps) : headline(moment, choice);
    if (this.at("says").textContent !== first) this.at("says").textContent = first;
    this.at("more").replaceChildren(...more.map((text) => el("li", {}, text)));
    const framed = now.sweeps ? " Framed in violet: what the last one changed." : "";
    this.at("status").textContent = now.sweeps === null ? `Solved exactly: ${counted(solved.world.states.length, "state")}.` : `After ${counted(now.sweeps, "sweep")} from nothing.${framed}`;
    this.at("forget").disabled = now.sweeps === 0;
    this.at("solve").disabled = now.sweeps === null;
    this.at("sweep").disabled = now.sweeps >= LIMITS.sweeps[1];
  }

  /** Returns `[4][N+1]`: what is shown of each action, as solved or as swept. */
  vectors() {
    const { table } = this.solved;
    return table ? ACTIONS.map((_, a) => table.map((of) => of[4 * this.state + a])) : this.moment.vectors;
  }

  drawNumbers() {
    const { choice, solved: { axis, before }, moment, at } = this, vectors = this.vectors(), { row, column } = this.solved.world.states[this.state];
    const news = before && new Set(vectors.flatMap((of, a) => of.flatMap((value, i) => (isSame(value, before[i][4 * this.state + a]) ? [] : [`${a},${i}`]))));
    drawBars(at("bars"), { vectors, choice, axis, news });
    drawLegend(at("legend"), { axis });
    const hasFoil = choice.foil >= 0, contrast = hasFoil ? delta({ vectors }, choice.action, choice.foil) : null;
    at("contrast-figure").hidden = !hasFoil;
    if (hasFoil) {
      const names = [choice.action, choice.foil].map((a) => ACTIONS[a]);
      at("contrast-title").textContent = `${names.join(" minus ")}: above the line is what speaks for ${names[0]}, below it what speaks for ${names[1]}`;
      drawContrast(at("contrast"), { row: contrast, axis, names });
    }
    at("caption").textContent = `Expected discounted reward at row ${row}, column ${column}${before ? ", as swept so far" : ""}`;
    drawTable(at("table"), { vectors, contrast, totals: before ? null : moment.totals, choice, axis });
  }

  /** Shows where the choice flips: none where that was not looked for, `[]` where it never does. */
  showFlips(roots, instead = "") {
    const { at, now: { gamma }, moment, choice } = this, flips = roots ?? [];
    const told = flipSentences(moment, choice, flips).join(" ") || (roots ? neverFlips(moment, choice) : instead);
    const where = flips.length ? ["The choice flips at γ = ", el("b", { id: "flip-at" }, flips.map((root) => root.toPrecision(5)).join(", ")), ". "] : [];
    at("flip").classList.remove("unknown");
    at("flip-words").replaceChildren(...where, told);
    at("flip-try").hidden = !flips.length;
    this.nearest = flips.toSorted((a, b) => Math.abs(a - gamma) - Math.abs(b - gamma))[0];
    at("gamma-track").replaceChildren(at("gamma-range"), ...flips.map((root) => {
      const mark = el("i", { title: `flips at ${root.toPrecision(5)}` });
      mark.style.left = `calc(8px + (100% - 16px) * ${root / LIMITS.gamma[1]})`;
      return mark;
    }));
  }

  fault(message) {
    this.isFaulty = message !== "";
    this.at("fault").hidden = !this.isFaulty;
    this.at("fault").textContent = message;
    for (const part of this.shadowRoot.querySelectorAll(".tell, .numbers")) {
      part.classList.toggle("stale", this.isFaulty);
      part.inert = this.isFaulty;
    }
  }

  // ---- fields, tools, and what to take along -----------------------------------------------------

  fill() {
    const { at } = this, options = (names) => names.map(([value, text]) => el("option", { value }, text));
    at("map").append(...options([...Object.keys(MAPS).map((name) => [name, name]), ["", "your own"]]));
    at("map").lastChild.hidden = true;
    for (const id of ["action", "foil"]) at(id).append(...options([["", ""], ...ACTIONS.map((name, a) => [a, name])]));
    at("fields").append(...Object.entries(FIELDS).map(([name, [label, about, least, most, step]]) => {
      const range = el("input", { type: "range", id: `${name}-range`, min: least, max: most, step, "aria-label": `${label}, slider` });
      const field = el("input", { type: "number", id: name, min: LIMITS[name][0], max: LIMITS[name][1], step, "aria-describedby": `${name}-about` });
      return el("div", { className: "field" }, el("label", { htmlFor: name }, label, el("small", { id: `${name}-about` }, about)), el("div", { className: "track", id: `${name}-track` }, range), field);
    }));
  }

  /** Returns what a setting is: as chosen, or as the map has it. */
  value(name) {
    const own = { slip: this.drawn?.slip, treasure: this.drawn && treasureOf(this.drawn) }[name];
    return this.now[name] ?? own ?? null;
  }

  drawFields() {
    for (const name of Object.keys(FIELDS)) {
      const value = name === "treasure" && treasureOf(this.drawn) === null ? null : this.value(name);
      const [field, range] = [this.at(name), this.at(`${name}-range`)];
      if (name === "treasure" && value !== null) range.max = Math.max(10, 5 * Math.abs(treasureOf(this.drawn)), range.max);
      field.disabled = range.disabled = value === null;
      field.setAttribute("aria-invalid", "false");
      if (this.shadowRoot.activeElement !== field || Number(field.value) !== value) field.value = value ?? "";
      range.value = value ?? 0;
      range.setAttribute("aria-valuetext", value === null ? "none on this map" : plain(value));
    }
  }

  drawTools() {
    const key = JSON.stringify([...this.drawn.legend]);
    if (this.tools === key) return;
    this.tools = key;
    this.at("tools").replaceChildren(...toolButtons(this.drawn.legend, this.tool));
  }

  drawShare() {
    this.at("command").textContent = commandOf(this.now);
    this.at("file").textContent = this.now.text === null ? `${this.now.map}.txt` : OWN_MAP;
  }

  /** Returns the address of this page with all that was chosen. */
  link() {
    return `${location.href.split("#")[0]}#${toHash(this.now)}`;
  }

  // ---- what a reader does ------------------------------------------------------------------------

  listen() {
    const { at } = this, on = (id, kind, act) => at(id).addEventListener(kind, act);
    on("map", "change", () => { this.past = []; this.change({ map: at("map").value, text: null, state: null, slip: null, treasure: null, action: null, foil: null }); });
    on("undo", "click", () => this.change(this.past.pop()));
    on("tools", "change", (event) => { this.tool = event.target.value; });
    for (const name of Object.keys(FIELDS)) for (const id of [name, `${name}-range`]) on(id, "input", (event) => this.set(name, event.target));
    for (const id of ["action", "foil"]) on(id, "change", () => this.change({ [id]: at(id).value === "" ? null : Number(at(id).value) }));
    on("collected", "change", () => {
      const { row, column } = this.solved.world.states[this.state];
      this.change({ state: `${row},${column},${at("collected").value}` });
    });
    on("sweep", "click", () => this.change({ sweeps: (this.now.sweeps ?? 0) + 1 }));
    on("forget", "click", () => this.change({ sweeps: 0 }));
    on("solve", "click", () => this.change({ sweeps: null }));
    on("flip-try", "click", () => this.change({ gamma: Math.min(LIMITS.gamma[1], beyond(this.nearest, this.now.gamma)) }));
    on("copy", "click", () => this.copy(at("command").textContent, "The command is copied."));
    on("link", "click", () => this.copy(this.link(), "The link is copied: it opens this very page."));
    on("save", "click", () => this.save());
    on("text", "change", () => this.redraw(at("text").value));
    on("grid", "click", (event) => this.touch(event.target.closest(".cell")));
    on("grid", "keydown", (event) => this.onKey(event));
    this.shadowRoot.addEventListener("keydown", (event) => event.stopPropagation()); // pages around it have keys of their own
    window.addEventListener("hashchange", () => {
      const chosen = fromHash(location.hash, MAPS);
      if (!chosen) return; // a heading of the page around it
      this.now = chosen;
      this.update();
      this.scrollIntoView();
    });
  }

  set(name, input) {
    const value = Number(input.value), { badInput, rangeOverflow, rangeUnderflow } = input.validity;
    const isGood = input.value !== "" && !badInput && !rangeOverflow && !rangeUnderflow && (input.step !== "1" || Number.isInteger(value));
    input.setAttribute("aria-invalid", String(!isGood));
    if (!isGood) return;
    const isAsDrawn = (name === "slip" && value === this.drawn.slip) || (name === "treasure" && value === treasureOf(this.drawn));
    this.change({ [name]: isAsDrawn ? null : value });
  }

  /** Uses the tool on a cell. */
  touch(cell) {
    if (!cell) return;
    const row = Number(cell.dataset.row), column = Number(cell.dataset.column);
    for (const other of this.at("grid").querySelectorAll('[tabindex="0"]')) other.tabIndex = -1;
    cell.tabIndex = 0;
    if (this.tool !== "drone") return this.put(row, column, this.tool);
    if (this.isFaulty) return;
    const isStart = this.grid.rows[row][column] === "S";
    if (findState(this.solved.world, `${row},${column}`) < 0) {
      this.at("place").textContent = `The drone can never be at row ${row}, column ${column}.`;
    } else this.change({ state: isStart ? null : `${row},${column}` });
  }

  /** Draws a letter on the map; the start moves, and is never drawn over. */
  put(row, column, letter) {
    const rows = this.drawn.rows.map((line) => [...line]);
    if (rows[row][column] === letter) return;
    if (rows[row][column] === "S") {
      this.at("place").textContent = "There has to be a start: put it elsewhere first.";
      return;
    }
    if (letter === "S") for (const line of rows) if (line.includes("S")) line[line.indexOf("S")] = ".";
    rows[row][column] = letter;
    this.redraw(mapText({ head: this.drawn.head, rows: rows.map((line) => line.join("")) }));
  }

  onKey(event) {
    const cell = event.target.closest(".cell"), moves = { ArrowUp: [-1, 0], ArrowDown: [1, 0], ArrowLeft: [0, -1], ArrowRight: [0, 1] };
    if (!cell || event.ctrlKey || event.metaKey || event.altKey) return;
    const row = Number(cell.dataset.row), column = Number(cell.dataset.column);
    if (event.key in moves) {
      const [down, right] = moves[event.key], next = this.at("grid").querySelector(`[data-row="${row + down}"][data-column="${column + right}"]`);
      if (next) [cell.tabIndex, next.tabIndex] = [-1, 0];
      next?.focus();
    } else if (event.key === "Enter" || event.key === " ") this.touch(cell);
    else if (["Delete", "Backspace"].includes(event.key)) this.put(row, column, ".");
    else if (this.drawn.legend.has(event.key)) this.put(row, column, event.key);
    else return;
    event.preventDefault();
  }

  async copy(text, done) {
    try {
      await navigator.clipboard.writeText(text);
      this.at("copied").textContent = done;
    } catch { // a page that is opened from disk may not be allowed to
      this.at("copied").textContent = `The browser does not allow it. Copy this: ${text}`;
    }
  }

  save() {
    const link = el("a", { download: this.at("file").textContent, href: URL.createObjectURL(new Blob([this.at("text").value], { type: "text/plain" })) });
    link.click();
    URL.revokeObjectURL(link.href);
  }
}

if (!customElements.get("trdlab-playground")) customElements.define("trdlab-playground", Playground);
