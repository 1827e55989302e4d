"use strict";
(function () {
  const D = JSON.parse(document.getElementById("data").textContent);
  const T = D.taken.length, N = D.time_axis.horizon, A = D.actions.length;
  const byId = (id) => document.getElementById(id);
  const now = { step: D.step, action: "", foil: "", pinned: null, over: null, timer: 0 };

  // ---- numbers and words ---------------------------------------------------------------------

  /** Returns what `packed` has written, as arrays in arrays; what is no number is null. */
  function inArrays({ shape, type, bytes }) {
    const raw = Uint8Array.from(atob(bytes), (c) => c.charCodeAt(0)).buffer;
    const of = { single: Float32Array, double: Float64Array, share: Uint16Array }[type];
    const values = new of(raw), share = type === "share";
    let next = 0;
    const read = () => {
      const value = share ? values[next++] / 65534 : values[next++];
      return Number.isNaN(value) || (share && value > 1) ? null : value;
    };
    const nested = ([length, ...rest]) => Array.from({ length }, () => (rest.length ? nested(rest) : read()));
    return nested(shape);
  }

  for (const name of ["components", "probabilities", "chances"]) if (D[name]) D[name] = inArrays(D[name]);
  const row = (t, a) => D.components[t][a];
  const isAllowed = (t, a) => D.probabilities[t][a] !== null || D.components[t][a][0] !== null;
  const sum = (values) => values.reduce((x, y) => x + y, 0);
  const whole = (n) => n.toLocaleString("en-US");

  function said(x, digits = 2) {
    if (x === 0) return "0";
    const size = Math.abs(x), before = Math.floor(Math.log10(size)) + 1; // the point
    return (x < 0 ? "−" : "") + String(Number(size.toPrecision(Math.max(digits, before))));
  }

  /** Returns numbers with as few digits as tell them apart. */
  function apart(values) {
    const kinds = (of) => new Set(of).size;
    const digits = [2, 3, 4, 5].find((k) => kinds(values.map((x) => said(x, k))) === kinds(values)) ?? 6;
    return values.map((x) => said(x, digits));
  }

  function percent(p) {
    return p > 0 && p < 0.01 ? "below 1 %" : Math.round(100 * p) + " %";
  }

  const total = (t, a) => sum(row(t, a));
  const isLarger = (x, y) => x - y > 0.001 * Math.max(Math.abs(x), Math.abs(y)); // to be told

  /** Returns the action and the foil of a step, as chosen, or else as the agent does. */
  function pair(t) {
    const [usual, next] = D.usual[t];
    const one = now.action === "" || !isAllowed(t, +now.action) ? usual : +now.action;
    if (now.foil === "none") return [one, null];
    let other = one === usual ? next : usual;
    if (now.foil !== "" && isAllowed(t, +now.foil)) other = +now.foil;
    return [one, other === one ? null : other];
  }

  /** Returns a step's bar that is larger than such forecasts are usually off by, or any but 0. */
  function standsOut(t, i, a) {
    const known = judged(t, a);
    return Math.abs(row(t, a)[i]) > ((known && known.off_by[i]) || 0);
  }

  const judged = (t, a) => (D.probabilities[t][a] > 0 || !D.foils ? D.trust : D.foils);

  /** Returns how far a bar can be trusted: as the worse of the two actions. */
  function doubt(t, i, pair) {
    const found = pair.filter((a) => a !== null).map((a) => judged(t, a)).filter(Boolean);
    if (found.some((of) => of.status[i] === "bad")) return "bad";
    return found.some((of) => of.doubtful[i]) ? "open" : "";
  }

  function el(name, properties = {}, ...children) {
    const made = document.createElement(name);
    Object.assign(made, properties);
    made.append(...children);
    return made;
  }

  function svg(name, attributes = {}, text = "") {
    const made = document.createElementNS("http://www.w3.org/2000/svg", name);
    for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
    if (text) made.textContent = text;
    return made;
  }

  // ---- pictures ------------------------------------------------------------------------------

  const sheets = D.pictures ? D.pictures.sheets.map(() => null) : [];

  function withSheet(i, then) {
    let held = sheets[i];
    if (held === null) {
      held = sheets[i] = { image: new Image(), waiting: [] };
      held.image.onload = () => {
        for (const one of held.waiting.splice(0)) one(held.image);
      };
      held.image.src = D.pictures.sheets[i][0];
    }
    if (held.image.complete && held.image.naturalWidth) then(held.image);
    else held.waiting.push(then);
  }

  /** Draws a picture by its number, and a box around what changed in it. */
  function paint(canvas, number, box = null) {
    const [i, at] = D.pictures.where[number];
    const [, width, height, columns] = D.pictures.sheets[i];
    canvas.dataset.picture = number;
    withSheet(i, (image) => {
      if (canvas.dataset.picture !== String(number)) return; // another one is wanted by now
      canvas.width = width;
      canvas.height = height;
      canvas.classList.toggle("pixels", Math.max(width, height) < 300);
      const pen = canvas.getContext("2d");
      const left = (at % columns) * width, top = Math.floor(at / columns) * height;
      pen.drawImage(image, left, top, width, height, 0, 0, width, height);
      if (box === null) return;
      const room = Math.max(2, Math.round(width / 40));
      pen.lineWidth = Math.max(1.5, width / 60);
      pen.strokeStyle = "#ffb000";
      const [y0, x0, y1, x1] = box;
      pen.strokeRect(x0 - room, y0 - room, x1 - x0 + 2 * room, y1 - y0 + 2 * room);
    });
  }

  function clip(number) {
    const came = D.gallery.came[number];
    const frames = came.clip.map(([k, picture]) => {
      const canvas = el("canvas");
      canvas.setAttribute("role", "img");
      const word = k < 1 ? `${1 - k} before` : k > 1 ? `${k - 1} after` : came.reward < 0 ? "cost" : "reward";
      canvas.setAttribute("aria-label", word);
      paint(canvas, picture, k >= 1 ? came.box : null);
      return el("div", { className: k === 1 ? "after" : "" }, canvas, el("span", { textContent: word }));
    });
    const what = came.reward < 0 ? `cost of ${said(-came.reward)}` : `reward of ${said(came.reward)}`;
    const text = `A ${what} at step ${whole(came.step)}`;
    const caption = el("figcaption", {}, came.own ? "" : `${text} of another episode`);
    if (came.own) caption.append(el("a", { href: `#step-${came.step}`, textContent: text }));
    const figure = el("figure", { className: "clip" });
    if (frames.length) figure.append(el("div", { className: "row" }, ...frames));
    figure.append(caption);
    return figure;
  }

  function showFrame() {
    const t = now.step;
    if (D.pictures) {
      paint(byId("frame"), D.pictures.at[t]);
      byId("frame").setAttribute("aria-label", `What is seen at step ${t}`);
    } else if (D.texts) {
      byId("words").textContent = D.texts.texts[D.texts.at[t]];
    }
    const buttons = [...byId("strip").children], here = buttons.findLast((button) => button.dataset.step <= t);
    for (const button of buttons) button.classList.toggle("here", button === here);
  }

  function setUpScreen() {
    byId("frame").hidden = byId("looks").hidden = !D.pictures;
    byId("words").hidden = !!D.pictures || !D.texts;
    byId("screen").classList.toggle("text", !D.pictures);
    byId("screen").hidden = !D.pictures && !D.texts;
    if (!D.pictures) return;
    const count = Math.min(T, 12);
    for (let i = 0; i < count; i++) {
      const t = count === 1 ? 0 : Math.round((i * (T - 1)) / (count - 1));
      const canvas = el("canvas");
      paint(canvas, D.pictures.at[t]);
      const button = el("button", { type: "button", tabIndex: -1, onclick: () => go(t) }, canvas);
      button.setAttribute("aria-label", `Go to step ${t}`);
      button.dataset.step = t;
      byId("strip").append(button);
    }
  }

  // ---- bars ----------------------------------------------------------------------------------

  /** One scale for the whole episode, so that bars can be compared; the very largest leave it. */
  const scale = (function () {
    const shown = D.usual.map(([one], t) => D.components[t][one].slice(0, N || 1));
    const sizes = shown.map((values) => Math.max(...values.map(Math.abs))).sort((x, y) => x - y);
    let least = 0, most = 0; // of all actions: costs have room also where the agent avoids them
    for (const value of D.components.flat(2)) {
      least = Math.min(least, value);
      most = Math.max(most, value);
    }
    const limit = 1.1 * (sizes[Math.floor(0.98 * (T - 1))] || Math.max(most, -least));
    const low = -Math.min(limit, -1.1 * least), high = Math.min(limit, 1.1 * most);
    return low === high ? { low: 0, high: 1 } : { low, high };
  })();

  function ticks() {
    const span = scale.high - scale.low, rough = span / 4;
    const power = 10 ** Math.floor(Math.log10(rough));
    const unit = [1, 2, 2.5, 5, 10].map((k) => k * power).find((u) => u >= rough);
    const found = [];
    for (let k = Math.ceil(scale.low / unit); k * unit <= scale.high; k++) found.push(k * unit);
    return found;
  }

  /** Where the bars of a component stand, in pixels; the rest is set apart. */
  function place(width) {
    const left = 44, right = 26, gap = N ? 0.8 : 0;
    const each = (width - left - right) / (N + 1 + gap);
    return { left, each, at: (i) => left + each * (i + (i === N ? gap : 0)) };
  }

  function drawBars() {
    const box = byId("bars"), width = Math.max(240, box.clientWidth), height = Math.max(160, box.clientHeight);
    const top = 18, bottom = height - (scale.low < 0 ? 46 : 32), t = now.step, chosen = pair(t);
    const y = (value) => bottom - ((value - scale.low) / (scale.high - scale.low)) * (bottom - top);
    const { each, at } = place(width);
    const canvas = svg("svg", { viewBox: `0 0 ${width} ${height}`, "aria-hidden": "true" });
    for (let i = 0; i <= N; i++) {
      const found = doubt(t, i, chosen);
      if (found) canvas.append(svg("rect", { class: `ground-${found}`, x: at(i), y: top - 6, width: each + 0.5, height: bottom - top + 6 }));
    }
    for (const value of ticks()) {
      canvas.append(svg("line", { class: value === 0 ? "zero" : "grid", x1: 40, x2: width, y1: y(value), y2: y(value) }));
      canvas.append(svg("text", { x: 36, y: y(value) + 4, "text-anchor": "end" }, said(Number(value.toPrecision(6)))));
    }
    const drawn = chosen.filter((a) => a !== null), cut = [];
    const thick = Math.max(1, (each * (each > 12 ? 0.8 : 0.92)) / drawn.length);
    drawn.forEach((a, k) => {
      row(t, a).forEach((value, i) => {
        if (value === 0) return;
        const shown = Math.min(Math.max(value, scale.low), scale.high);
        const from = y(Math.max(0, shown)), to = y(Math.min(0, shown));
        const x = at(i) + (each - thick * drawn.length) / 2 + k * thick;
        const pale = doubt(t, i, [a]) ? " pale" : "";
        const kind = k === 0 ? "bar-one" : "bar-other";
        canvas.append(svg("rect", { class: kind + pale, x, y: from, width: Math.max(0.8, thick - 0.6), height: Math.max(0.7, to - from) }));
        if (Math.abs(value - shown) < 0.01 * (scale.high - scale.low)) return;
        const gap = value > 0 ? from + 8 : to - 12; // it leaves the scale: a gap in the bar, and its number
        canvas.append(svg("rect", { class: "gap", x: x - 1, y: gap, width: thick + 2, height: 4 }));
        cut.push({ x: x + thick / 2, y: value > 0 ? from - 5 : to + 13, text: said(value) });
      });
    });
    const ends = {}; // of the numbers in a line: they stand beside each other
    for (const { x, y, text } of cut.sort((a, b) => a.x - b.x)) {
      const size = 7.5 * text.length, left = Math.min(Math.max(x - size / 2, 44, ends[y] ?? 0), width - size);
      if (left > x + size) continue;
      ends[y] = left + size + 4;
      canvas.append(svg("text", { class: "number", x: left, y }, text));
    }
    if (chosen.includes(D.taken[t])) {
      came(t).forEach((signs, i) => signs.forEach((sign, k) => {
        canvas.append(mark(sign, at(i) + each / 2 + (signs.length > 1 ? 8 * k - 4 : 0), bottom + (scale.low < 0 ? 17 : 3), 4));
      }));
    }
    const wide = Math.max(1, Math.ceil(34 / each)), unit = [1, 2, 5, 10, 20, 50, 100].find((u) => u >= wide) ?? wide;
    for (let i = 0; i < N; i += unit) {
      if (N && at(i) + 20 > at(N) - 22) break;
      const label = i === 0 ? "now" : `+${i * D.time_axis.width}`;
      canvas.append(svg("text", { x: at(i) + each / 2, y: height - 8, "text-anchor": "middle" }, label));
    }
    canvas.append(svg("text", { x: Math.min(at(N) + each / 2, width - 16), y: height - 8, "text-anchor": "middle" }, N ? "later" : "all"));
    const focus = component();
    canvas.append(svg("rect", { class: isNone(t) ? "chosen none" : "chosen", x: at(focus), y: top - 6, width: each, height: bottom - top + 8, rx: 2 }));
    for (let i = 0; i <= N; i++) {
      const hit = svg("rect", { class: "hit", x: at(i), y: 0, width: each, height, "data-component": i });
      hit.addEventListener("pointerenter", (event) => { if (event.pointerType === "mouse") hover(i); });
      hit.addEventListener("click", () => { now.pinned = now.pinned === i ? null : i; drawBars(); look(); });
      canvas.append(hit);
    }
    box.replaceChildren(canvas);
  }

  function hover(i) {
    if (now.over === i) return;
    now.over = i;
    look();
    const frame = byId("bars").querySelector(".chosen");
    const { at } = place(Math.max(240, byId("bars").clientWidth));
    frame.setAttribute("x", at(component()));
    frame.classList.remove("none");
  }

  /** Returns a mark of a reward, which points up, or of a cost, which points down. */
  function mark(sign, x, y, half) {
    const [tip, foot] = sign > 0 ? [y, y + 8] : [y + 8, y];
    const points = `${x},${tip} ${x - half},${foot} ${x + half},${foot}`;
    return svg("polygon", { class: sign > 0 ? "paid" : "cost", points });
  }

  const endOf = (t) => D.ends.find((end) => end >= t) ?? T - 1; // the last step that counts

  /** Returns for each component of a step the signs of what really came, 1 and −1. */
  function came(t) {
    const found = D.when.map(() => new Set());
    for (let k = t; k <= endOf(t); k++) {
      if (D.rewards[k]) found[Math.min(N, Math.floor((k - t) / D.time_axis.width))].add(Math.sign(D.rewards[k]));
    }
    return found.map((signs) => [...signs].sort((x, y) => y - x));
  }

  /** Says whether nobody has chosen a bar, and none of the single steps stands out. */
  function isNone(t) {
    const a = pair(t)[0];
    return N > 0 && now.over === null && now.pinned === null && !D.when.some((_, i) => i < N && standsOut(t, i, a));
  }

  /** Returns the component that is looked at: pointed at, chosen, or else the largest of a step. */
  function component() {
    if (now.over !== null) return now.over;
    if (now.pinned !== null) return now.pinned;
    const values = row(now.step, pair(now.step)[0]).slice(0, N || 1).map(Math.abs);
    return values.indexOf(Math.max(...values));
  }

  /** Names in the menus what is usual, what is taken, and what cannot be done. */
  function menus() {
    const t = now.step, [usual, next] = D.usual[t], taken = D.taken[t], one = pair(t)[0];
    const name = (a) => (a === null ? "" : `: ${D.actions[a]}`);
    const kind = taken === usual ? "what it does" : "usual action";
    byId("action").options[0].textContent = kind + name(usual);
    const isBest = next === null || !isLarger(total(t, next), total(t, usual));
    const against = one === usual ? (isBest ? "the next best" : "another action") + name(next) : kind + name(usual);
    byId("foil").options[0].textContent = against;
    for (const option of document.querySelectorAll(".choose option")) {
      const a = Number(option.value);
      if (option.value === "" || option.value === "none") continue;
      const more = !isAllowed(t, a) ? " (not possible here)" : a === taken && a !== usual ? " (taken here)" : "";
      option.textContent = D.actions[a] + more;
    }
  }

  function legend() {
    const t = now.step, chosen = pair(t), shown = chosen.filter((a) => a !== null), parts = [];
    const add = (kind, text) => parts.push(el("span", {}, el("i", { className: `i-${kind}` }), text));
    const totals = apart(shown.map((a) => total(t, a)));
    shown.forEach((a, k) => add(k ? "other" : "one", `${D.actions[a]}: ${totals[k]} in all`));
    const grounds = new Set(D.when.map((_, i) => doubt(t, i, chosen)));
    if (grounds.has("open")) add("open", "not proved: few tests, or none");
    if (grounds.has("bad")) add("bad", "no better than a guess");
    if (shown.includes(D.taken[t]) && came(t).flat().length) {
      const signs = new Set(came(t).flat()), words = { "1": ["paid", "▲"], "-1": ["cost", "▼"] };
      const marks = [1, -1].filter((sign) => signs.has(sign)).map((sign) => el("span", { className: words[sign][0], textContent: words[sign][1] }));
      parts.push(el("span", {}, ...marks, ` what really came in this episode, after ${D.actions[D.taken[t]]}`));
    }
    byId("legend").replaceChildren(...parts);
  }

  // ---- what is told --------------------------------------------------------------------------

  function tell() {
    const t = now.step, [one, other] = pair(t), taken = D.taken[t];
    byId("where").textContent = `Step ${whole(t)} of ${whole(T - 1)}.`;
    const paid = D.rewards[t] ? ` That brings a ${D.rewards[t] < 0 ? "cost" : "reward"} of ${said(Math.abs(D.rewards[t]))}.` : "";
    byId("doing").textContent = `${takes(t)}${paid}${lastWords(t)}`;
    const name = (a, b) => `${a},${b === null ? "" : b}`; // what differs is true both ways
    const numbers = D.told[t][name(one, other)] ?? D.told[t][name(other, one)];
    const lines = numbers ? numbers.map((i) => D.sentences[i]) : [];
    byId("says").setAttribute("aria-live", now.timer ? "off" : "polite");
    setText(byId("says"), lines[0] ?? untold(t, one, other));
    const more = [...lines.slice(1, 4), ...preference(t, one, other)];
    byId("more").replaceChildren(...more.map((text) => el("li", { textContent: text })));
    const input = byId("step");
    input.value = t;
    input.setAttribute("aria-valuetext", `Step ${t} of ${T - 1}: ${D.actions[taken]}`);
  }

  /** Says what the agent does at a step, and what else it usually does there. */
  function takes(t) {
    const taken = D.taken[t], usual = D.usual[t][0], name = (a) => D.actions[a];
    const chance = D.probabilities[t][taken], most = D.probabilities[t][usual];
    if (taken === usual) {
      return `The agent takes ${name(taken)}${chance === null || chance >= 0.995 ? "" : ` (chosen with ${percent(chance)})`}.`;
    }
    if (most === null) return `Here it takes ${name(taken)}; usually ${name(usual)}.`;
    const how = most > 0.5 ? "usually" : most > chance ? "more likely is" : "as likely is";
    return `Here it takes ${name(taken)}, by a random draw; ${how} ${name(usual)} (${percent(most)}).`;
  }

  /** Says, where the bars go beyond it, that the recording ends. */
  function lastWords(t) {
    const left = T - 1 - t;
    if (D.ends.includes(T - 1)) return left ? "" : " The episode ends here.";
    if (!left) return " The recording ends here: what came later is not known.";
    const isNear = left < N * D.time_axis.width;
    return isNear ? ` The recording ends ${left} ${left === 1 ? "step" : "steps"} later: what came then is not known.` : "";
  }

  /** Says why a pair has no sentences. */
  function untold(t, one, other) {
    if (other !== null) return "Of these two, the bars and the table tell.";
    const isSame = now.foil !== "" && now.foil !== "none" && +now.foil === one;
    return isSame ? `Both are ${D.actions[one]}: the bars show it alone.` : "The bars show one action alone.";
  }

  /** Says, where it is so, that the agent does not take what is worth most by these values. */
  function preference(t, one, other) {
    if (one !== D.usual[t][0] || other === null || !isLarger(total(t, other), total(t, one))) return [];
    const more = said(total(t, other) - total(t, one));
    return [`It takes what its policy prefers. Of these values, that of ${D.actions[other]} is larger by ${more}.`];
  }

  function setText(element, text) {
    if (element.textContent !== text) element.textContent = text;
  }

  function look() {
    const t = now.step, i = component(), chosen = pair(t), one = chosen[0];
    const isChosen = now.over !== null || now.pinned !== null, when = D.when[i];
    if (isNone(t)) {
      setText(byId("look-when"), "No step stands out");
      const sizes = D.when.map((_, k) => (k < N && judged(t, one) ? judged(t, one).off_by[k] || 0 : 0));
      const off = said(Math.max(...sizes));
      setText(byId("look-what"), off === "0" ? `With ${D.actions[one]}, no bar of a step differs from 0.`
        : `With ${D.actions[one]}, every bar of a step is smaller than such forecasts are usually off by: about ${off}.`);
      setText(byId("look-alike"), "");
      clips([]);
      return looks(t, i, one);
    }
    const first = D.time_axis.width > 1 ? "The largest of the groups of steps: " : "The largest step: ";
    setText(byId("look-when"), isChosen || !N ? when[0].toUpperCase() + when.slice(1) : first + when);
    const shown = chosen.filter((a) => a !== null), amounts = (of) => apart(shown.map((a) => of * row(t, a)[i]));
    const bars = amounts(1);
    let text = `Expected reward: ${shown.map((a, k) => `${D.actions[a]} ${bars[k]}`).join(", ")}`;
    const later = i > 0 && i < N && D.time_axis.width === 1 && D.time_axis.gamma > 0 ? amounts(D.time_axis.gamma ** -i) : bars;
    text += later.join() === bars.join() ? "." : `, discounted. Without the discount: ${later.join(", ")}.`;
    const what = scale.low < 0 ? "a reward or a cost" : "a reward";
    if (D.chances && i < N && D.chances[t][one]) text += ` With ${D.actions[one]}, the chance of ${what} then is ${percent(D.chances[t][one][i])}.`;
    const known = judged(t, one), off = known ? known.off_by[i] : null;
    if (off) text += ` Such forecasts are usually off by about ${said(off)}.`;
    setText(byId("look-what"), text);
    const value = D.components[t][one][i];
    let level = i < N ? D.gallery.edges[i].filter((edge) => edge > 0 && Math.abs(value) >= edge).length : 0;
    if (value < 0) level = -level;
    const alike = D.gallery.alike[`${i},${level}`];
    setText(byId("look-alike"), alike ? alike.says : "");
    clips(alike && standsOut(t, i, one) ? alike.examples : []);
    looks(t, i, one);
  }

  /** Shows some rewards that came, if they are not shown already. */
  function clips(examples) {
    const box = byId("look-clips"), key = examples.join();
    if (box.dataset.key === key) return;
    box.dataset.key = key;
    box.replaceChildren(...examples.map(clip));
  }

  function drawTable() {
    if (!byId("numbers").open) return;
    const t = now.step, chosen = pair(t).filter((a) => a !== null), table = byId("table");
    table.caption.textContent = `Expected discounted reward at step ${t}`;
    const heads = ["when", ...chosen.map((a) => D.actions[a]), ...(D.chances ? [`chance of ${scale.low < 0 ? "a reward or a cost" : "a reward"} with ${D.actions[chosen[0]]}`] : []), "tested"];
    const head = el("tr", {}, ...heads.map((text) => el("th", { scope: "col", textContent: text })));
    table.tHead.replaceChildren(head);
    const words = { bad: "no better than a guess", open: "not proved", "": D.trust ? "better than a guess" : "no" };
    const rows = D.when.map((when, i) => {
      const cells = chosen.map((a) => row(t, a)[i].toPrecision(6).replace(/\.?0+$/, ""));
      if (D.chances) cells.push(i < N && D.chances[t][chosen[0]] ? percent(D.chances[t][chosen[0]][i]) : "");
      cells.push(words[doubt(t, i, chosen)]);
      const first = el("th", { scope: "row", textContent: when });
      return el("tr", {}, first, ...cells.map((text) => el("td", { textContent: text })));
    });
    table.tBodies[0].replaceChildren(...rows);
  }

  // ---- the whole episode ---------------------------------------------------------------------

  const values = D.taken.map((a, t) => total(t, a));

  function drawLine() {
    const box = byId("line"), width = Math.max(240, box.clientWidth), height = Math.max(80, box.clientHeight);
    const top = 22, bottom = height - 18, most = Math.max(0, ...values), least = Math.min(0, ...values);
    const x = (t) => 14 + (T === 1 ? 0 : (t / (T - 1)) * (width - 28));
    const y = (v) => bottom - ((v - least) / (most - least || 1)) * (bottom - top);
    const canvas = svg("svg", { viewBox: `0 0 ${width} ${height}` });
    canvas.append(svg("line", { class: "grid", x1: 0, x2: width, y1: y(0), y2: y(0) }));
    canvas.append(svg("polyline", { class: "value", points: values.map((v, t) => `${x(t).toFixed(1)},${y(v).toFixed(1)}`).join(" ") }));
    const half = Math.min(5, Math.max(1, width / (4 * D.rewards.filter(Boolean).length))); // many are narrow
    D.rewards.forEach((reward, t) => {
      if (reward) canvas.append(mark(reward, x(t), bottom + 5, half));
    });
    D.key.forEach((t, k) => {
      canvas.append(svg("circle", { class: "mark", cx: x(t), cy: 11, r: 9 }));
      canvas.append(svg("text", { class: "mark-text", x: x(t), y: 15 }, String(k + 1)));
    });
    canvas.append(svg("line", { class: "head", id: "head", x1: x(now.step), x2: x(now.step), y1: 20, y2: height }));
    box.onclick = (event) => {
      const at = (event.clientX - box.getBoundingClientRect().left) * (width / box.clientWidth);
      go(Math.round(((at - 14) / (width - 28)) * (T - 1)));
    };
    box.replaceChildren(canvas);
    box.moveHead = () => {
      for (const end of ["x1", "x2"]) byId("head").setAttribute(end, x(now.step));
    };
  }

  // ---- where it looks ------------------------------------------------------------------------

  const unpacked = {};

  /** Returns the levels of some steps in a row [steps, h, w, N+1], once they are unpacked. */
  function mapsOf(chunk, then) {
    if (unpacked[chunk]) return void unpacked[chunk].then(then);
    const bytes = Uint8Array.from(atob(D.maps.packed[chunk]), (c) => c.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
    unpacked[chunk] = new Response(stream).arrayBuffer().then((held) => new Int8Array(held));
    unpacked[chunk].then(then);
  }

  /** Shows where the agent looks for a bar that somebody points at or has chosen. */
  function looks(t, i, one) {
    const canvas = byId("looks"), wanted = now.over !== null || now.pinned !== null;
    const isKnown = D.maps && D.pictures && one === D.usual[t][0];
    canvas.hidden = !(wanted && isKnown);
    const why = !D.maps || !D.pictures ? "" : !isKnown ? "Where it looks is known only of the action that it usually takes." : !wanted
      ? "Tap or point at a bar to see where the agent looks for it."
      : "Yellow spots raise this bar, violet ones lower it. They show where it looks, not why.";
    setText(byId("look-where"), why);
    if (canvas.hidden) return;
    const { height, width, levels, together } = D.maps, key = `${t},${i}`;
    canvas.dataset.key = key;
    mapsOf(Math.floor(t / together), (all) => {
      if (canvas.dataset.key !== key) return;
      const small = el("canvas", { width, height }), pen = small.getContext("2d");
      const image = pen.createImageData(width, height), first = (t % together) * width * height;
      for (let place = 0; place < width * height; place++) {
        const level = all[(first + place) * (N + 1) + i] / levels;
        image.data.set(level > 0 ? [255, 190, 0] : [150, 100, 255], 4 * place);
        image.data[4 * place + 3] = 215 * Math.abs(level);
      }
      pen.putImageData(image, 0, 0);
      const [, w, h] = D.pictures.sheets[D.pictures.where[D.pictures.at[t]][0]];
      Object.assign(canvas, { width: w, height: h });
      canvas.getContext("2d").drawImage(small, 0, 0, w, h);
    });
  }

  // ---- going about ---------------------------------------------------------------------------

  function draw() {
    showFrame();
    tell();
    menus();
    legend();
    drawBars();
    look();
    drawTable();
    byId("line").moveHead();
  }

  function go(t) {
    const step = Math.min(T - 1, Math.max(0, t));
    if (step !== now.step) now.pinned = null;
    now.step = step;
    if (/^#step-/.test(location.hash) && location.hash !== `#step-${step}`) {
      history.replaceState(null, "", location.href.split("#")[0]); // it would tell of another step
    }
    draw();
  }

  function play(wanted) {
    window.clearInterval(now.timer);
    now.timer = 0;
    if (wanted) {
      if (now.step === T - 1) go(0);
      const pause = Math.min(600, Math.max(60, 1000 * (D.seconds ?? 0.4)));
      now.timer = window.setInterval(() => (now.step < T - 1 ? go(now.step + 1) : play(false)), pause);
    }
    byId("play").textContent = wanted ? "Pause" : "Play";
    byId("play").setAttribute("aria-pressed", String(wanted));
    if (!wanted) tell();
  }

  function choose(i) {
    now.over = null;
    now.pinned = Math.min(N, Math.max(0, i));
    drawBars();
    look();
  }

  function onKey(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const target = event.target, tag = target.tagName, key = event.key;
    if (tag === "SELECT" || (tag === "INPUT" && ![" ", "Escape"].includes(key))) return;
    const moves = { ArrowLeft: -1, ArrowRight: 1 };
    if (target.id === "bars" && key in moves) choose(component() + moves[key]);
    else if (key === "Escape") { now.pinned = now.over = null; drawBars(); look(); }
    else if (key in moves) { play(false); go(now.step + moves[key]); }
    else if (key === "Home") go(0);
    else if (key === "End") go(T - 1);
    else if (key === " " && !["BUTTON", "SUMMARY", "A"].includes(tag)) play(!now.timer);
    else return;
    event.preventDefault();
  }

  function followHash() {
    const found = /^#step-(\d+)$/.exec(location.hash);
    if (!found) return;
    play(false);
    go(Number(found[1]));
    byId("player").scrollIntoView({ block: "start" });
  }

  function begin() {
    setUpScreen();
    if (D.chosen) {
      now.action = byId("action").value = String(D.chosen[0]);
      now.foil = byId("foil").value = D.chosen[1] === null ? "none" : String(D.chosen[1]);
    }
    drawLine();
    draw();
    for (const box of document.querySelectorAll("[data-group]")) {
      box.append(...D.gallery.groups[box.dataset.group].map(clip));
    }
    byId("step").addEventListener("input", () => {
      const wanted = Number(byId("step").value); // it is set anew when the play stops
      play(false);
      go(wanted);
    });
    byId("back").addEventListener("click", () => go(now.step - 1));
    byId("next").addEventListener("click", () => go(now.step + 1));
    byId("play").addEventListener("click", () => play(!now.timer));
    for (const name of ["action", "foil"]) {
      byId(name).addEventListener("change", () => { now[name] = byId(name).value; draw(); });
    }
    byId("bars").addEventListener("pointerleave", () => { if (now.over !== null) { now.over = null; drawBars(); look(); } });
    byId("numbers").addEventListener("toggle", drawTable);
    document.addEventListener("keydown", onKey);
    document.addEventListener("click", (event) => {
      const link = event.target.closest && event.target.closest('a[href^="#step-"]');
      if (link && link.getAttribute("href") === location.hash) followHash(); // it would do nothing
    });
    window.addEventListener("hashchange", followHash);
    window.addEventListener("resize", () => { drawLine(); drawBars(); });
    followHash();
  }

  begin();
})();
