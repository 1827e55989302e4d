// The exact solution of a model, its decomposition over time, and single sweeps towards it.
// All tables are flat: entry `row = 4 * state + action`.

const A = 4;
const SETTLED = 1e-15; // of its parts: a value that changes by less is solved
const FADED = 1e-22; // of the largest reward: a value that changes by less is solved, too
const TIE = 1e-11; // of their parts: actions that differ by less are equally good
const RELATIVE_ZERO = 1e-12; // two numbers closer than this, relative to the larger, are the same
export const SAME_TOTAL = 1e-9; // sums of many steps that differ by less are the same
const MOST_PASSES = 200000;

export const isSame = (a, b, share = RELATIVE_ZERO) => Math.abs(a - b) <= share * Math.max(Math.abs(a), Math.abs(b));
export const difference = (a, b) => (isSame(a, b) ? 0 : a - b);
export const sum = (values) => values.reduce((a, b) => a + b, 0);

/** Calls `each(k)` for every outcome k of a row. */
function outcomesOf({ offsets }, row, each) {
  for (let k = offsets[row]; k < offsets[row + 1]; k++) each(k);
}

/** Returns E[R] + γ·E[value of the next state] of a row, and the sum of the sizes of its parts. */
function lookAhead(world, gamma, values, row) {
  let reward = 0, later = 0, size = 0;
  outcomesOf(world, row, (k) => {
    const p = world.probability[k], value = world.terminated[k] ? 0 : p * values[world.next[k]];
    reward += p * world.reward[k];
    later += value;
    size += Math.abs(value);
  });
  return [reward + gamma * later, Math.abs(reward) + gamma * size];
}

/** Returns for each state the first of the actions that are best but for rounding. */
function greedy(q, sizes) {
  const policy = new Int32Array(q.length / A), tied = new Uint8Array(q.length);
  for (let s = 0; s < policy.length; s++) {
    const rows = [0, 1, 2, 3].map((a) => A * s + a), best = rows.reduce((x, y) => (q[y] > q[x] ? y : x));
    const near = rows.filter((row) => q[best] - q[row] <= TIE * Math.max(sizes[row], sizes[best]));
    policy[s] = near[0] - A * s;
    if (near.length > 1) for (const row of near) tied[row] = 1;
  }
  return { policy, tied };
}

/**
 * Returns the optimal values of a model: `{gamma, values, q, policy, tied}`.
 *
 * Value iteration in place, to and fro, until every value stands still but for rounding. Where the
 * best actions are never paid the value is 0, and not what is left of an early guess. Of tied
 * actions the policy takes the first.
 */
export function solve(world, gamma, guess = null) {
  const values = guess ? guess.slice() : new Float64Array(world.states.length);
  settle(world, values, (s) => {
    let best = [-Infinity, 0];
    for (let row = A * s; row < A * s + A; row++) {
      const found = lookAhead(world, gamma, values, row);
      if (found[0] > best[0]) best = found;
    }
    return best;
  });
  const look = () => {
    const found = Array.from({ length: A * values.length }, (_, row) => lookAhead(world, gamma, values, row));
    const q = Float64Array.from(found, ([value]) => value);
    return { q, ...greedy(q, found.map(([, size]) => size)) };
  };
  const { isPaid } = fate(world, look().policy);
  isPaid.forEach((is, s) => { if (!is) values[s] = 0; });
  const { q, policy, tied } = look();
  world.over.forEach((isOver, s) => { if (isOver) tied.fill(0, A * s, A * s + A); });
  return { gamma, values, q, policy, tied };
}

/** Updates values in place, to and fro, until none moves; `next(s)` returns a value and its size. */
function settle(world, values, next) {
  const S = values.length, faded = FADED * Math.max(...world.reward.map(Math.abs));
  for (let pass = 0, moved = true; moved && pass < MOST_PASSES; pass++) {
    moved = false;
    for (let i = 0; i < S; i++) {
      const s = pass % 2 ? i : S - 1 - i; // backwards first: states are numbered away from the start
      const [value, size] = next(s);
      if (Math.abs(value - values[s]) > SETTLED * size + faded) moved = true;
      values[s] = value;
    }
  }
}

/** Returns in which states a policy can still be paid, and in which it may be paid without an end. */
function fate(world, policy) {
  const S = world.states.length, ends = new Uint8Array(S), paid = new Uint8Array(S), before = Array.from({ length: S }, () => []);
  for (let s = 0; s < S; s++) {
    outcomesOf(world, A * s + policy[s], (k) => {
      if (world.terminated[k]) ends[s] = 1;
      else before[world.next[k]].push(s);
      if (world.reward[k]) paid[s] = 1;
    });
  }
  const isPaid = reached(paid, before);
  const comesToAnEnd = reached(ends.map((end, s) => end || !isPaid[s]), before);
  return { isPaid, isEndless: reached(comesToAnEnd.map((is) => !is), before) };
}

// ---- the decomposition ---------------------------------------------------------------------------

/**
 * Returns means of a sum one step earlier, with or without the rewards on the way, and whether
 * chance has no part in it: whatever happens, the same is to come.
 */
function earlier(world, { gamma, policy }, { mean, sure }, withRewards) {
  const found = { mean: new Float64Array(mean.length), sure: new Uint8Array(mean.length) };
  for (let row = 0; row < mean.length; row++) {
    let total = 0, size = 0, only = null, isSure = true;
    outcomesOf(world, row, (k) => {
      const s = world.next[k], then = A * s + policy[s], goesOn = !world.terminated[k];
      const value = (withRewards ? world.reward[k] : 0) + (goesOn ? gamma * mean[then] : 0);
      total += world.probability[k] * value;
      size += world.probability[k] * Math.abs(value);
      isSure &&= (!goesOn || !!sure[then]) && (only === null || isSame(only, value));
      only ??= value;
    });
    found.mean[row] = Math.abs(total) <= SETTLED * size ? 0 : total; // rewards and costs that cancel
    found.sure[row] = isSure;
  }
  return found;
}

const nothing = (rows) => ({ mean: new Float64Array(rows), sure: new Uint8Array(rows).fill(1) });

function repeated(count, change, value) {
  for (let i = 0; i < count; i++) value = change(value);
  return value;
}

/** Returns of the whole return what `earlier` does of a sum: it is sure as long as nothing refutes it. */
function wholeReturn(world, solution) {
  let all = { mean: solution.q, sure: nothing(solution.q.length).sure };
  for (;;) {
    const { sure } = earlier(world, solution, all, true);
    if (sure.every((is, row) => is === all.sure[row])) return all;
    all = { mean: solution.q, sure };
  }
}

/**
 * Returns the components of every state and action, `[N+1]` of `{mean, sure}`.
 *
 * Component i < N is the discounted reward of the steps i·w … (i+1)·w − 1; component N, the
 * residual, is (γP)^(N·w) applied to Q. It is not taken as a difference.
 */
function decompose(world, solution, horizon, width) {
  const once = (what) => earlier(world, solution, what, false);
  let group = repeated(width, (what) => earlier(world, solution, what, true), nothing(solution.q.length));
  let rest = wholeReturn(world, solution);
  const components = [];
  for (let i = 0; i < horizon; i++) {
    components.push(group);
    if (i < horizon - 1) group = repeated(width, once, group);
    rest = repeated(width, once, rest);
  }
  return [...components, rest];
}

/** Returns the components `[N+1]` of one action. */
export const vector = (components, state, action) => components.map(({ mean }) => mean[A * state + action]);

/**
 * Returns the table after one Bellman sweep: every action looks w steps ahead, as the best actions
 * go by the table as it is, and takes over what the table says there.
 *
 * This is the one equation: the reward in front of γ^w times what the table says, the last two
 * entries folded into one.
 */
function sweep(world, gamma, width, table) {
  const q = table[0].map((_, row) => sum(table.map((of) => of[row])));
  const { policy } = greedy(q, q.map(Math.abs)), by = { gamma, policy }, rows = q.length;
  const shifted = table.map((mean) => repeated(width, (what) => earlier(world, by, what, false), { ...nothing(rows), mean }).mean);
  const reward = repeated(width, (what) => earlier(world, by, what, true), nothing(rows)).mean;
  const target = [reward, ...shifted], last = target.pop(); // N + 2 entries, the last two folded
  target[target.length - 1] = target.at(-1).map((value, row) => value + last[row]);
  return target;
}

/**
 * Returns all that follows from a model and γ, N and w: its solution, components, totals, and where
 * ties matter; with `sweeps` also the table after so many sweeps from zeros, and the one before it.
 */
export function solved(world, { gamma, N, w, sweeps = null }) {
  const solution = solve(world, gamma), whole = totals(world, solution);
  const all = { world, solution, totals: whole, components: decompose(world, solution, N, w), ambiguous: ambiguous(world, solution, whole, N * w), axis: { gamma, horizon: N, width: w } };
  if (sweeps === null) return all;
  let table = Array.from({ length: N + 1 }, () => new Float64Array(solution.q.length)), before = table;
  for (let k = 0; k < sweeps; k++) [before, table] = [table, sweep(world, gamma, w, table)];
  return { ...all, table, before };
}

// ---- totals without a discount, and ties that matter ---------------------------------------------

/** Returns the rows’ expected totals with γ = 1 under the policy, NaN where no total exists. */
function totals(world, { policy }) {
  const { isPaid, isEndless } = fate(world, policy), values = new Float64Array(world.states.length);
  settle(world, values, (s) => (isPaid[s] && !isEndless[s] ? lookAhead(world, 1, values, A * s + policy[s]) : [0, 0]));
  isEndless.forEach((is, s) => { if (is) values[s] = NaN; });
  return Float64Array.from({ length: A * values.length }, (_, row) => lookAhead(world, 1, values, row)[0]);
}

/** Returns `begin` and all that edges lead to from there. */
function reached(begin, edges) {
  const found = Uint8Array.from(begin), open = [...found.keys()].filter((s) => found[s]);
  while (open.length) {
    for (const s of edges[open.pop()]) {
      if (!found[s]) open.push(s);
      found[s] = 1;
    }
  }
  return found;
}

/** Returns the states in which actions tie that pay at other steps, or other totals. */
function ambiguous(world, solution, whole, steps) {
  const found = new Uint8Array(world.states.length);
  if (!solution.tied.some(Boolean)) return found;
  const parts = [...decompose(world, solution, steps, 1).map(({ mean }) => [mean, RELATIVE_ZERO]), [whole, SAME_TOTAL]];
  for (const [of, share] of parts) {
    for (let s = 0; s < found.length; s++) {
      const tied = [...of.slice(A * s, A * s + A)].filter((value, a) => solution.tied[A * s + a] && !Number.isNaN(value));
      if (tied.length < 2) continue;
      const [least, most, size] = [Math.min(...tied), Math.max(...tied), Math.max(...tied.map(Math.abs))];
      const noise = share === SAME_TOTAL ? 0 : TIE * Math.abs(solution.values[s]);
      if (most - least > share * size + noise) found[s] = 1;
    }
  }
  return found;
}

/** Returns the states that can follow any first action, and best ones after it. */
export function following(world, { policy, tied }, state) {
  const edges = world.states.map((_, s) => {
    const next = [];
    for (let a = 0; a < A; a++) {
      if (s !== state && a !== policy[s] && !tied[A * s + a]) continue;
      outcomesOf(world, A * s + a, (k) => { if (!world.terminated[k]) next.push(world.next[k]); });
    }
    return next;
  });
  return reached(edges.map((_, s) => s === state), edges);
}

/**
 * Returns how likely each action leaves a state as it is. It is 0 of an action that pays less than
 * another one that surely stays.
 */
export function stays(world, state) {
  const found = [0, 1, 2, 3].map((a) => {
    let chance = 0, reward = 0;
    outcomesOf(world, A * state + a, (k) => {
      if (world.next[k] === state && !world.terminated[k]) chance += world.probability[k];
      reward += world.probability[k] * world.reward[k];
    });
    return { chance, reward, isSure: chance >= 1 - RELATIVE_ZERO };
  });
  const most = Math.max(...found.map(({ isSure, reward }) => (isSure ? reward : -Infinity)));
  return found.map(({ chance, reward, isSure }) => (isSure && reward < most ? 0 : chance));
}
