// The page: what is chosen, what follows from it, and how a reader changes it.
// MAPS, ICONS, LAYOUT and STYLE are put in front by trdlab/playground/__init__.py.

import { ACTIONS, buildWorld, changed, findState, mapText, parseMap, treasureOf } from "./world.js";
import { ambiguous, decompose, emptyTable, isSame, solve, sum, sweep, totals } from "./solver.js";
import { choose, delta, flipSentences, headline, momentOf } from "./words.js";
import { cellName, cellPicture, drawBars, drawContrast, drawLegend, drawMap, drawTable, el, symbols } from "./pictures.js";
import { flipsOfGamma } from "./flips.js";
import { counted, plain, said, sentence, number } from "./numbers.js";

const DEFAULTS = { map: "drone", text: null, gamma: 0.95, N: 4, w: 1, slip: null, treasure: null, state: null, action: null, foil: null, sweeps: null };
const FIELDS = { // label, explanation, least, most of the slider, step, most that can be typed
  gamma: ["γ", "discount", 0, 0.999, 0.001, 0.999],
  N: ["N", "components", 0, 12, 1, 40],
  w: ["w", "steps in each", 1, 6, 1, 40],
  slip: ["slip", "goes sideways", 0, 1, 0.01, 1],
  treasure: ["treasure", "pays", 0, 20, 0.1, 1e6],
};
const OWN_MAP = "my-map.txt";
const MOST_SWEEPS = 1000, MOST_FLIP_STATES = 600, PAUSE = 200; // ms without a change, before what takes longer

class Playground extends HTMLElement {
  connectedCallback() {
    if (this.shadowRoot) return;
    const root = this.attachShadow({ mode: "open" }), style = new CSSStyleSheet();
    style.replaceSync(STYLE);
    root.adoptedStyleSheets = [style];
    root.append(symbols(ICONS), el("div", { id: "all", innerHTML: LAYOUT }));
    this.at = (id) => root.getElementById(id);
    this.now = { ...DEFAULTS };
    this.past = [];
    this.tool = "drone";
    this.fill();
    this.listen();
    this.readHash();
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
      this.grid = changed(drawn, { slip: now.slip, treasure: treasureOf(drawn) === null ? null : now.treasure });
      this.solved = this.solve(buildWorld(this.grid));
      this.fault("");
    } catch (error) {
      if (!("cure" in error)) throw error;
      this.fault(error.message);
    }
    this.draw();
    window.clearTimeout(this.timer);
    this.timer = window.setTimeout(() => this.later(), PAUSE);
  }

  solve(world) {
    const { gamma, N, w, sweeps } = this.now, axis = { gamma, horizon: N, width: w };
    const solution = solve(world, gamma), components = decompose(world, solution, N, w), whole = totals(world, solution);
    const solved = { world, solution, components, totals: whole, ambiguous: ambiguous(world, solution, whole, N * w), axis };
    if (sweeps === null) return solved;
    let table = emptyTable(world, N), before = table;
    for (let k = 0; k < sweeps; k++) [before, table] = [table, sweep(world, gamma, w, table)];
    return { ...solved, table, before };
  }

  /** Does what takes longer, once nothing changes for a moment: the flips, and the address. */
  later() {
    if (this.isChanged) history.replaceState(null, "", this.link());
    const { world } = this.solved ?? {}, isShown = world && !this.isFaulty && this.now.sweeps === null && this.choice?.foil >= 0;
    if (!isShown) return this.showFlips(null);
    if (world.states.length > MOST_FLIP_STATES) return this.showFlips(null, "With so many states, other discounts are not tried here.");
    const { state, choice, moment } = this;
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
    const { solved: { world, solution, table, before } } = this, stateAt = new Map(), width = this.grid.rows[0].length;
    if (drone) {
      world.states.forEach(({ row, column, collected }, s) => {
        const place = row * width + column, isLike = collected.join() === drone.collected.join();
        if (isLike || !stateAt.has(place)) stateAt.set(place, s);
      });
    }
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
    const { moment, choice, now } = this, [first, ...more] = now.sweeps === null ? headline(moment, choice) : this.sweepWords();
    if (this.at("says").textContent !== first) this.at("says").textContent = first;
    this.at("more").replaceChildren(...more.map((text) => el("li", {}, text)));
    this.at("status").textContent = now.sweeps === null ? `Solved exactly: ${counted(this.solved.world.states.length, "state")}.` : `After ${counted(now.sweeps, "sweep")} from nothing.`;
    this.at("forget").disabled = now.sweeps === 0;
    this.at("solve").disabled = now.sweeps === null;
    this.at("sweep").disabled = now.sweeps >= MOST_SWEEPS;
  }

  sweepWords() {
    const { solved: { table, components, world }, moment, choice: { action, foil }, now } = this;
    if (moment.isOver) return headline(moment, this.choice);
    const q = this.vectors().map(sum), pair = [action, foil].filter((a) => a >= 0);
    const so_far = pair.map((a) => `${ACTIONS[a]} ${said(q[a])}`).join(" and "), exact = pair.map((a) => `${ACTIONS[a]} ${said(moment.q[a])}`).join(" and ");
    const apart = Math.max(...table.flatMap((of, i) => [...of].map((value, row) => Math.abs(value - components[i].mean[row]))));
    const largest = Math.max(...world.reward.map(Math.abs));
    const begin = now.sweeps ? `After ${counted(now.sweeps, "sweep")} the values are: ${so_far}.` : "Before the first sweep nothing is expected anywhere.";
    const rest = apart <= 1e-9 * largest ? "The sweeps have found the solution." : sentence`Solved, they are: ${exact}. Over the whole map, the component that is furthest off is off by ${number(apart)}.`;
    return [begin, rest, "Each sweep looks as far ahead as one component is wide, and moves all that was known one component on."];
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
      at("contrast-title").textContent = `${names[0]} minus ${names[1]}: up speaks for ${names[0]}, down for ${names[1]}`;
      drawContrast(at("contrast"), { row: contrast, axis, names });
    }
    const caption = `Discounted reward that is expected after each action at row ${row}, column ${column}${before ? ", as far as the sweeps have come" : ""}`;
    drawTable(at("table"), { vectors, contrast, totals: before ? null : moment.totals, choice, axis, caption });
  }

  showFlips(roots, instead = "") {
    const { at, now: { gamma }, moment, choice } = this, flips = roots ?? [];
    const nearest = flips.length ? flips.reduce((a, b) => (Math.abs(b - gamma) < Math.abs(a - gamma) ? b : a)) : null;
    const never = roots ? [`At no γ from ${plain(Math.min(0.01, gamma))} to ${plain(Math.max(0.99, gamma))} that was tried does the choice between the two flip.`] : [instead];
    at("flip-words").replaceChildren(...(nearest === null ? never : ["The choice flips at γ = ", el("b", { id: "flip-at" }, flips.map((root) => root.toPrecision(5)).join(", ")), `. ${flipSentences(moment, choice, flips).join(" ")}`]));
    at("flip-try").hidden = nearest === null;
    this.nearest = nearest;
    const most = FIELDS.gamma[3];
    at("gamma-track").replaceChildren(at("gamma-range"), ...flips.map((root) => {
      const mark = el("i", { title: `flips at ${root.toPrecision(5)}` });
      mark.style.left = `calc(8px + (100% - 16px) * ${root / most})`;
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
    at("fields").append(...Object.entries(FIELDS).map(([name, [label, about, least, most, step, limit]]) => {
      const range = el("input", { type: "range", id: `${name}-range`, min: least, max: most, step, "aria-label": `${label}, slider` });
      const field = el("input", { type: "number", id: name, min: name === "treasure" ? -limit : least, max: limit, step: name === "treasure" ? "any" : step, "aria-describedby": `${name}-about` });
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
    const entries = [["drone", "choose", { hasDrone: true }], ...[...this.drawn.legend].map(([letter, cell]) => [letter, letter === "S" ? "start" : cellName(cell).replace("floor", "empty").replace("ends the episode", "ends").replace(" of ", " "), { isStart: letter === "S" }])];
    const floor = this.drawn.legend.get(".");
    this.at("tools").replaceChildren(...entries.map(([letter, label, how]) => {
      const input = el("input", { type: "radio", name: "tool", value: letter, checked: letter === this.tool, "aria-label": letter === "drone" ? "choose a state" : `${label}, letter ${letter}` });
      return el("label", { className: "tool", title: letter === "drone" ? "choose the state that is explained" : `draw: ${letter}` }, input, cellPicture(this.drawn.legend.get(letter) ?? floor, how), label);
    }));
  }

  drawShare() {
    const { now } = this, state = now.state !== null && now.state;
    const options = { "--map": now.text === null ? now.map : OWN_MAP, "--gamma": plain(now.gamma), "--N": now.N, "--w": now.w, "--slip": now.slip, "--treasure": now.treasure, "--state": state || null, "--action": ACTIONS[now.action], "--foil": ACTIONS[now.foil] };
    const words = Object.entries(options).filter(([, value]) => value !== null && value !== undefined);
    this.at("command").textContent = ["trdlab gridworld", ...words.map(([name, value]) => `${name} ${typeof value === "number" ? plain(value) : value}`)].join(" ");
    this.at("file").textContent = now.text === null ? `${now.map}.txt` : OWN_MAP;
  }

  /** Returns the address of this page with all that was chosen behind #. */
  link() {
    const chosen = Object.entries(this.now).filter(([name, value]) => value !== null && (name === "map" || value !== DEFAULTS[name]));
    return `${location.href.split("#")[0]}#${new URLSearchParams(chosen)}`;
  }

  readHash() {
    const given = new URLSearchParams(location.hash.slice(1));
    if (!location.hash.includes("=")) return false;
    const within = (name, least, most) => {
      const value = Number(given.get(name));
      return given.get(name) !== null && value >= least && value <= most ? value : DEFAULTS[name];
    };
    const whole = (...of) => { const value = within(...of); return value === null ? null : Math.round(value); };
    const map = given.get("map") in MAPS ? given.get("map") : DEFAULTS.map, state = given.get("state");
    this.now = {
      map, text: given.get("text"), state: /^\d+,\d+(,\d+)?$/.test(state) ? state : null,
      gamma: within("gamma", 0, FIELDS.gamma[5]), N: whole("N", 0, FIELDS.N[5]), w: whole("w", 1, FIELDS.w[5]),
      slip: within("slip", 0, 1), treasure: within("treasure", -FIELDS.treasure[5], FIELDS.treasure[5]),
      action: whole("action", 0, 3), foil: whole("foil", 0, 3), sweeps: whole("sweeps", 0, MOST_SWEEPS),
    };
    return true;
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
    on("flip-try", "click", () => this.change({ gamma: Number(this.nearest.toFixed(3)) }));
    on("copy", "click", () => this.copy(at("command").textContent, "The command is copied."));
    on("link", "click", () => this.copy(this.link(), "The link is copied: it opens this very page."));
    on("save", "click", () => this.save());
    on("text", "change", () => this.redraw(at("text").value));
    on("grid", "click", (event) => this.touch(event.target.closest(".cell")));
    on("grid", "keydown", (event) => this.onKey(event));
    this.shadowRoot.addEventListener("keydown", (event) => event.stopPropagation()); // pages around it have keys of their own
    window.addEventListener("hashchange", () => { if (this.readHash()) this.update(); });
  }

  set(name, input) {
    const value = Number(input.value), isRange = input.type === "range";
    const isGood = input.value !== "" && (isRange || input.checkValidity());
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
