// The discounts at which a preference changes sides, the best actions found anew at each.
// The search is that of trdlab/explanations/moment/sensitivity.py.

import { difference, solve } from "./solver.js";

const SAMPLES = 64, PRECISION = 1e-13, DIP_STEPS = 34, GOLDEN = (Math.sqrt(5) - 1) / 2;

/** Returns the γ between 0.01 and 0.99, or the present one, at which Q(action) − Q(foil) changes its sign. */
export function flipsOfGamma(world, gamma, state, action, foil) {
  let values = null;
  const gap = (g) => {
    const solved = solve(world, g, values);
    values = solved.values;
    return difference(solved.q[4 * state + action], solved.q[4 * state + foil]);
  };
  return findFlips(gap, Math.min(0.01, gamma), Math.max(0.99, gamma));
}

/** Returns the nearest γ with three decimals on the other side of a flip. */
export const beyond = (flip, gamma) => (flip < gamma ? Math.floor(1000 * flip) : Math.ceil(1000 * flip)) / 1000;

/**
 * Returns where a continuous gap changes its sign, in order.
 *
 * It is sampled evenly, and each change of sign is refined. Where it dips towards zero between
 * three samples its bottom is sought too, for a pair of flips may hide there.
 */
export function findFlips(gap, low, high) {
  let known = Array.from({ length: SAMPLES + 1 }, (_, i) => low + (i / SAMPLES) * (high - low)).map((x) => [x, gap(x)]);
  const add = (places) => {
    known = [...known, ...places.map((x) => [x, gap(x)])].sort((a, b) => a[0] - b[0]);
  };
  add(pairs(known).filter(([[, a], [, b]]) => a * b === 0).map(([[x], [y]]) => x + 0.382 * (y - x)));
  add(bottoms(gap, known));
  const nonzero = pairs(known.filter(([, value]) => value !== 0));
  return nonzero.filter(([[, a], [, b]]) => a * b < 0).map(([left, right]) => root(gap, left, right));
}

const pairs = (items) => items.slice(1).map((item, i) => [items[i], item]);

function bottoms(gap, known) {
  const found = [];
  for (const [[x, a], [y, b]] of [known.slice(0, 2), known.slice(-2).reverse()]) {
    if (a * b > 0 && Math.abs(a) < Math.abs(b)) found.push(bottom(gap, Math.min(x, y), Math.max(x, y), a));
  }
  for (let i = 1; i < known.length - 1; i++) {
    const [[x, before], [, here], [z, after]] = known.slice(i - 1, i + 2);
    const isOneSign = before * after > 0 && before * here >= 0;
    if (isOneSign && Math.abs(here) < Math.min(Math.abs(before), Math.abs(after))) found.push(bottom(gap, x, z, before));
  }
  return found;
}

/** Golden-section search for the least sign · gap, which stops below zero. */
function bottom(gap, low, high, sign) {
  const at = (x) => [x, sign * gap(x)];
  let a = at(high - GOLDEN * (high - low)), b = at(low + GOLDEN * (high - low));
  for (let i = 0; i < DIP_STEPS; i++) {
    if (Math.min(a[1], b[1]) < 0) return a[1] < b[1] ? a[0] : b[0];
    if (a[1] < b[1]) [high, b, a] = [b[0], a, at(b[0] - GOLDEN * (b[0] - low))];
    else [low, a, b] = [a[0], b, at(a[0] + GOLDEN * (high - a[0]))];
  }
  return (low + high) / 2;
}

/** Ridders' method: halves the bracket at least, and doubles the digits on smooth gaps. */
function root(gap, left, right) {
  let best = (left[0] + right[0]) / 2;
  while (right[0] - left[0] > PRECISION * Math.max(1, Math.abs(left[0]), Math.abs(right[0]))) {
    const middle = (left[0] + right[0]) / 2, atMiddle = gap(middle);
    if (atMiddle === 0) return middle;
    const step = ((middle - left[0]) * atMiddle) / Math.sqrt(atMiddle ** 2 - left[1] * right[1]);
    const last = best;
    best = middle + Math.sign(left[1] - right[1]) * step;
    const atBest = gap(best);
    if (atBest === 0 || Math.abs(best - last) <= PRECISION * Math.max(1, Math.abs(best))) return best;
    const places = [left, [middle, atMiddle], [best, atBest], right].sort((a, b) => a[0] - b[0]);
    [left, right] = pairs(places).find(([[, a], [, b]]) => a * b < 0);
  }
  return best;
}
