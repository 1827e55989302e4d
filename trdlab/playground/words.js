// What is said of a choice: the sentences of `trdlab gridworld`, found by the same rules.
// The rules are those of trdlab/explanations/moment: contrast.py, leads.py, steps.py, telling.py.

import { counted, digitsToTell, firstSteps, gains, gives, joined, number, percent, plain, said, sentence, size, whenOf } from "./numbers.js";
import { ACTIONS } from "./world.js";
import { SAME_TOTAL, difference, following, isSame, stays, sum, vector } from "./solver.js";

const NEGLIGIBLE = 0.01; // what is expected below this share is not worth a sentence
const SHARE = 0.2; // of a lead: what makes up so much of it is told as it stands soon
const SEEN = 1e-3; // of a sum: a cost that changes it as it is printed
const DECIDES = 0.8; // of all that differs: what lies at one step decides
const LEAST_DISCOUNT = 2.2250738585072014e-308 ** 0.25; // what is smaller cannot be taken out

/** Returns what is known of one state: an entry for each action, and what ties there. */
export function momentOf({ world, solution, components, totals, ambiguous, axis }, state) {
  const rows = ACTIONS.map((_, a) => 4 * state + a), vectors = rows.map((_, a) => vector(components, state, a));
  const later = following(world, solution, state);
  return {
    state,
    axis,
    vectors,
    q: vectors.map(sum),
    sure: rows.map((row) => components.map((of) => !!of.sure[row])),
    totals: rows.map((row, a) => (Math.abs(totals[row]) <= 1e-12 * sum(vectors[a].map(Math.abs)) ? 0 : totals[row])),
    best: solution.policy[state],
    stays: stays(world, state),
    isOver: world.over[state],
    tied: ambiguous[state] ? ACTIONS.filter((_, a) => solution.tied[rows[a]]) : [],
    tiedLater: ambiguous.filter((is, s) => is && later[s]).length - (ambiguous[state] ? 1 : 0),
  };
}

/** Returns the action to explain and its foil (−1: none): what the best policy does, and the best real alternative. */
export function choose(moment, action = null, foil = null) {
  const { q, best } = moment, isLikelier = (a, b) => (b === best) - (a === best);
  const order = [0, 1, 2, 3].sort((a, b) => isLikelier(a, b) || (isSame(q[a], q[b]) ? a - b : q[b] - q[a]));
  const alternative = (given) => {
    const others = order.filter((a) => a !== given && moment.stays[a] <= 0.5);
    return others.find((a) => given === null || delta(moment, given, a).some(Boolean)) ?? others[0] ?? null;
  };
  const one = action ?? (order[0] !== foil ? order[0] : alternative(foil) ?? order[1]);
  return { action: one, foil: foil ?? alternative(one) ?? -1 };
}

/** Returns `[N+1]`: one action's components minus another's, 0 where they differ only by rounding. */
export const delta = ({ vectors }, action, foil) => vectors[action].map((value, i) => difference(value, vectors[foil][i]));

/** Returns the few sentences that matter most of a choice, the answer first. */
export function headline(moment, { action, foil }) {
  if (moment.isOver) return ["The episode is over here: no action pays anything any more."];
  if (foil < 0) return ["Every other action leaves things as they are, surely or most likely, so there is nothing to compare."];
  const told = contrast({ moment, action, foil, orders: [[action, foil], [foil, action]] });
  const kinds = (...names) => told.slice(1).filter(([kind]) => names.includes(kind));
  const byDiscount = kinds("better-by-discount", "better-against-total").length || ["better-by-discount", "better-against-total"].includes(told[0][0]);
  const brief = [told[0], ...kinds("overtakes", "makes-up")];
  brief.push(...(byDiscount ? kinds("different-totals", "better-by-discount", "better-against-total") : kinds("better", "equal-values")));
  return [...brief.map(([, text]) => text), ...ties(moment)];
}

/** Says how far sweeps have come, and how far that is from the solution. */
export function sweepWords(moment, choice, { table, components, world, axis }, sweeps) {
  if (moment.isOver) return headline(moment, choice);
  const pair = [choice.action, choice.foil].filter((a) => a >= 0), listed = (q) => pair.map((a) => `${name(a)} ${said(q(a))}`).join(" and ");
  const apart = Math.max(...table.map((of, i) => of.reduce((most, value, row) => Math.max(most, Math.abs(value - components[i].mean[row])), 0)));
  const now = listed((a) => sum(table.map((of) => of[4 * moment.state + a]))), then = listed((a) => moment.q[a]);
  const isThere = apart <= 1e-9 * Math.max(...world.reward.map(Math.abs)), group = axis.width === 1 ? "step" : counted(axis.width, "step");
  return [
    sweeps ? `After ${counted(sweeps, "sweep")} the values are: ${now}.` : "Before the first sweep nothing is expected anywhere.",
    isThere ? "The sweeps have found the solution." : sentence`Solved, they are: ${then}. Over the whole map, the component that is furthest off is off by ${number(apart)}.`,
    `Each sweep puts the reward of the next ${group} in front, and moves all that was known one component on.`,
  ];
}

/** Says where the preference changes sides as γ varies: at the nearest values below and above. */
export function flipSentences(moment, { action, foil }, roots) {
  const { q, axis: { gamma } } = moment, worse = q[action] > q[foil] ? foil : action;
  if (isSame(q[action], q[foil])) return []; // there is no preference to change
  const sides = [roots.filter((root) => root < gamma).reverse(), roots.filter((root) => root > gamma)];
  return sides.filter((side) => side.length).map(([nearest, second = null]) => {
    const digits = digitsToTell([nearest, gamma]), [low, high] = [nearest, second ?? gamma].sort((a, b) => a - b);
    const where = second === null ? (nearest < gamma ? "below" : "above") : `between ${said(low, digits)} and`;
    return sentence`${name(worse)} would be better if γ were ${where} ${said(second === null ? nearest : high, digits)} instead of ${plain(gamma)}.`;
  });
}

/** Says that the preference stays the same whatever γ is. */
export function neverFlips({ q }, { action, foil }) {
  const [better, worse] = q[action] > q[foil] ? [action, foil] : [foil, action];
  return `Whatever γ was, within the values tried, ${name(better)} is better than ${name(worse)}.`;
}

const name = (a) => ACTIONS[a];

// ---- the rules -----------------------------------------------------------------------------------

/** Returns `[kind, sentence]` of all that is told of how two actions differ, what matters most first. */
function contrast(choice) {
  const { moment, action, foil } = choice;
  if (!moment.vectors.some((row) => row.some(Boolean))) {
    const isChancy = moment.sure.some((row) => row.some((is) => !is));
    return [["nothing", isChancy ? "On average no action pays anything here, but single episodes differ." : "Nothing is expected of any action here."]];
  }
  const worth = [...totalsOf(choice), ...valuesOf(choice).slice(0, 1)];
  if (!delta(moment, action, foil).some(Boolean)) return [alike(choice), ...worth];
  const passing = turns(choice), decided = decidedAt(choice);
  if (decided.length && !passing.length) return [...decided, ...worth];
  return [...leads(choice).slice(0, 1), ...passing, ...worth, ...decided];
}

function ties({ tied, tiedLater }) {
  if (tied.length) return [sentence`${joined(tied)} are equally good here, but pay other amounts or at other times; the agent takes ${tied[0]}.`];
  return tiedLater ? [`In ${counted(tiedLater, "state")} to come several actions are equally good: totals and times depend on which is taken.`] : [];
}

function totalsOf({ moment, orders }) {
  const note = averages(moment, orders[0]) + (moment.tied.length || moment.tiedLater ? ", with ties broken as here" : "");
  const [a, b] = orders[0].map((x) => moment.totals[x]), told = [];
  if (isSame(a, b, SAME_TOTAL)) {
    return isByDiscount(moment, orders[0]) ? [] : [["equal-totals", sentence`Both bring ${number(a)} in total${note}.`]];
  }
  for (const [more, less] of orders) {
    const [x, y] = [more, less].map((of) => moment.totals[of]);
    if (x > y) told.push(["different-totals", sentence`In total ${name(more)} brings ${number(x)} and ${name(less)} ${number(y)}${note}.`]);
  }
  for (const [one] of orders) {
    if (Number.isNaN(moment.totals[one])) told.push(["no-total", `The rewards after ${name(one)} may never end, so there is no total.`]);
  }
  return told;
}

function valuesOf({ moment, orders }) {
  const { q, totals, axis: { gamma } } = moment, [one, other] = orders[0];
  if (isSame(q[one], q[other])) return [["equal-values", sentence`${name(one)} and ${name(other)} are worth the same: ${number(q[one])}.`]];
  const [better, worse] = q[one] > q[other] ? [one, other] : [other, one], told = [];
  const loss = `${percent(1 - gamma)} %`, values = [number(q[better]), number(q[worse])];
  if (isByDiscount(moment, orders[0])) {
    const average = isSure(moment, orders[0]) ? "" : " on average";
    told.push(["better-by-discount", sentence`Both pay ${number(totals[one])} in total${average}, but each step of waiting makes a reward count ${loss} less: ${name(better)} is worth ${values[0]}, ${name(worse)} ${values[1]}.`]);
  }
  if (totals[better] < totals[worse] && !isSame(totals[better], totals[worse], SAME_TOTAL)) {
    told.push(["better-against-total", sentence`But each step of waiting makes a reward count ${loss} less: ${name(better)} is worth ${values[0]}, ${name(worse)} ${values[1]}.`]);
  }
  told.push(["better", sentence`All steps counted, ${name(better)} is worth ${values[0]} and ${name(worse)} is worth ${values[1]} (γ = ${plain(gamma)}).`]);
  return told;
}

function alike({ moment, action, foil }) {
  const isAllTold = moment.axis.width === 1 && moment.vectors[action].at(-1) === 0;
  if (isAllTold) return ["alike", sentence`${name(action)} and ${name(foil)} lead to the same rewards at the same times${averages(moment, [action, foil])}.`];
  return ["alike", sentence`Nothing in these numbers tells ${name(action)} and ${name(foil)} apart.`];
}

/** Most of all that differs lies at one component, and speaks for the better action. */
function decidedAt({ moment, orders }) {
  const { q, vectors, axis: { horizon, width } } = moment;
  const pair = orders.find(([a, b]) => q[a] > q[b] && !isSame(q[a], q[b]));
  if (!pair || !horizon) return [];
  const apart = delta(moment, ...pair), i = apart.indexOf(Math.max(...apart));
  if (apart[i] < DECIDES * sum(apart.map(Math.abs))) return [];
  const [a, b] = pair, [x, y] = pair.map((of) => gains(vectors[of][i]));
  return [["decided-at", sentence`What comes ${whenOf(i, horizon, width)} decides: ${name(a)} ${x} and ${name(b)} ${y}${averages(moment, pair, i, i + 1)}.`]];
}

/** Which action is the first to lead clearly, told where it is furthest ahead, or as it stands soon. */
function leads({ moment, orders }) {
  const { axis: { horizon, width }, vectors } = moment, soon = soonOf(moment), found = [];
  for (const [leader, other] of orders) {
    const all = leadOf(moment, leader, other), inTheEnd = all.at(-1), least = leastLead(moment, leader, other);
    const lead = all.slice(0, -1).map((value) => (Math.abs(value) < least ? 0 : value));
    const begins = lead.findIndex((value) => value !== 0);
    if (begins < 0 || lead[begins] < 0) continue;
    const lost = lead.slice(begins).findIndex((value) => value <= 0);
    let until = lost < 0 ? horizon : begins + lost;
    if (soon > begins && Math.max(...lead.slice(0, soon)) >= SHARE * Math.max(...lead.slice(0, until))) until = Math.min(until, soon);
    const within = lead.slice(0, until);
    let count = within.indexOf(Math.max(...within)) + 1;
    if (count > soon && until === horizon && inTheEnd < 0) count = until;
    const [x, y] = [leader, other].map((a) => sum(vectors[a].slice(0, count)));
    found.push(leadSentence(moment, { leader, other, count, x, y, when: `in ${firstSteps(count * width)}` }));
  }
  return found;
}

function leadSentence(moment, { leader, other, count, x, y, when }) {
  const pair = [leader, other], note = averages(moment, pair, 0, count);
  const notable = pair.flatMap((a) => undiscounted(moment, a).slice(0, count).map((value) => (Math.abs(value) >= least(moment, a) ? value : 0)));
  if (x <= 0 && !notable.some((value) => value > 0)) {
    return ["costs-less", sentence`${name(leader)} costs less: ${size(Math.abs(x))} ${when}, while ${name(other)} costs ${number(0 - y)}${note}.`];
  }
  const isSeen = pair.some((a) => moment.vectors[a].slice(0, count).some((value) => value < -SEEN * Math.abs(x)));
  if (count <= soonOf(moment) && y >= 0 && !isSeen && !notable.some((value) => value < 0)) {
    return ["more-immediate", sentence`${name(leader)} gives more immediate rewards: ${number(x)} ${when}, while ${name(other)} ${gives(y)}${note}.`];
  }
  return ["pays-more", sentence`${when} ${name(leader)} ${gains(x)} and ${name(other)} ${gains(y)}${note}.`];
}

/** Where the running total of one action passes the other's, at a step or at the residual. */
function turns({ moment, action, foil }) {
  const { horizon, width } = moment.axis;
  return crossings(moment, action, foil).map(([leader, other, i]) => {
    if (i < horizon) {
      const [x, y] = [leader, other].map((a) => gains(sum(moment.vectors[a].slice(0, i + 1))));
      return ["overtakes", sentence`After ${firstSteps((i + 1) * width)} ${name(leader)} has overtaken ${name(other)}: added up, ${name(leader)} ${x} and ${name(other)} ${y}${averages(moment, [leader, other], 0, i + 1)}.`];
    }
    const more = number(delta(moment, leader, other)[i]);
    return ["makes-up", sentence`But what comes ${whenOf(i, horizon, width)} decides: with ${name(leader)}, that part is worth ${more} more${averages(moment, [leader, other], i, i + 1)}.`];
  });
}

/** Who passes whom, and at which component: a clear lead follows one of the other. */
function crossings(moment, action, foil) {
  const lead = leadOf(moment, action, foil), clearly = leastLead(moment, action, foil), runs = [];
  lead.forEach((value, i) => {
    if (!value) return;
    const last = runs.at(-1);
    if (last && lead[last[0]] > 0 === value > 0) last.push(i);
    else runs.push([i]);
  });
  const clear = runs.filter((run) => Math.max(...run.map((i) => Math.abs(lead[i]))) >= clearly);
  if (runs.length && !clear.includes(runs.at(-1)) && !isSame(moment.q[action], moment.q[foil])) clear.push(runs.at(-1));
  const found = [];
  for (let k = 1; k < clear.length; k++) {
    const isAhead = lead[clear[k][0]] > 0;
    if (isAhead !== lead[clear[k - 1][0]] > 0) found.push(isAhead ? [action, foil, clear[k][0]] : [foil, action, clear[k][0]]);
  }
  return found.length <= 2 ? found : found.slice(-1);
}

// ---- leads, and what counts ----------------------------------------------------------------------

const cumulated = (row) => row.map((_, i) => sum(row.slice(0, i + 1)));
const leadOf = ({ vectors }, a, b) => cumulated(vectors[a]).map((value, i) => difference(value, cumulated(vectors[b])[i]));
const soonOf = ({ axis: { horizon, width } }) => Math.min(horizon, Math.floor(Math.trunc(Math.max(4, 0.2 * horizon * width)) / width));
const isSure = ({ sure }, pair, from = 0, to = undefined) => pair.every((a) => sure[a].slice(from, to).every(Boolean));
const averages = (moment, pair, from, to) => (isSure(moment, pair, from, to) ? "" : ", on average");

function isByDiscount({ q, totals }, [a, b]) {
  return isSame(totals[a], totals[b], SAME_TOTAL) && totals[a] !== 0 && !isSame(q[a], q[b]);
}

const discount = ({ gamma, width }, i) => gamma ** (i * width);

/** Returns the explicit components without their discount, as far as it can be taken out. */
function undiscounted({ axis, vectors }, a) {
  const far = vectors[a].findIndex((_, i) => i === axis.horizon || discount(axis, i) < LEAST_DISCOUNT);
  return vectors[a].slice(0, far).map((value, i) => value / discount(axis, i));
}

/** Returns the least that stands out at a step, without its discount. */
function least(moment, a) {
  const { axis, vectors } = moment, begins = discount(axis, axis.horizon);
  const later = Math.abs(vectors[a].at(-1)) * (1 - axis.gamma ** axis.width);
  const rate = begins >= LEAST_DISCOUNT ? later / begins : 0;
  return NEGLIGIBLE * Math.max(0, ...undiscounted(moment, a).map(Math.abs), rate);
}

function leastLead(moment, a, b) {
  return Math.max(NEGLIGIBLE * Math.max(...leadOf(moment, a, b).map(Math.abs)), least(moment, a), least(moment, b));
}
