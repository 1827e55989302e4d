// Says where the playground's solver differs from the golden answers; run in a browser by the tests.
import * as words from "/words.js";
import { buildWorld, changed, findState, parseMap } from "/world.js";
import { solved } from "/solver.js";
import { flipsOfGamma } from "/flips.js";

const NEAR = 1e-9, NAMES = ["up", "down", "left", "right"];

/** Returns a line for each answer that differs. */
export function faults(cases) {
  return cases.flatMap((of, i) => faultsOf(of).map((fault) => `case ${i}: ${fault}`));
}

function faultsOf({ text, gamma, N, w, slip = null, treasure = null, num_states, states, swept }) {
  const found = [];
  const check = (is, what) => { if (!is) found.push(what); };
  const world = buildWorld(changed(parseMap(text), { slip, treasure }));
  check(world.states.length === num_states, `${world.states.length} states, not ${num_states}`);
  const answer = solved(world, { gamma, N, w, sweeps: swept ? 5 : null });
  states.forEach((want, k) => {
    const s = want.state, moment = words.momentOf(answer, s);
    check(findState(world, want.place) <= s, `no state at ${want.place}`);
    for (let a = 0; a < 4; a++) {
      check(isNear(moment.vectors[a], want.components[a]), `state ${s} ${NAMES[a]}: ${moment.vectors[a]}, not ${want.components[a]}`);
      check(isNear([answer.totals[4 * s + a]], [want.totals[a]]), `state ${s} ${NAMES[a]}: total ${answer.totals[4 * s + a]}, not ${want.totals[a]}`);
      const sofar = answer.table?.map((of) => of[4 * s + a]);
      check(!swept || isNear(sofar, swept[k][a]), `state ${s} ${NAMES[a]}: swept ${sofar}, not ${swept?.[k][a]}`);
    }
    const choice = words.choose(moment), names = [NAMES[choice.action], NAMES[choice.foil] ?? null];
    check(names.join() === want.pair.join(), `state ${s}: the choice is ${names}, not ${want.pair}`);
    const said = words.headline(moment, choice);
    check(said.join(" ") === want.sentences.join(" "), `state ${s}: “${said.join(" ")}”, not “${want.sentences.join(" ")}”`);
    if (!want.flips) return;
    const roots = flipsOfGamma(world, gamma, s, choice.action, choice.foil);
    check(isNear(roots, want.flips), `state ${s}: flips at ${roots}, not ${want.flips}`);
    const told = words.flipSentences(moment, choice, roots);
    check(told.join(" ") === want.flip_sentences.join(" "), `state ${s}: “${told.join(" ")}”, not “${want.flip_sentences.join(" ")}”`);
  });
  return found;
}

/** Returns whether numbers agree to 1e-9; null stands for what is no number. */
function isNear(one, other) {
  return one.length === other.length && one.every((x, i) => (other[i] === null ? Number.isNaN(x) : Math.abs(x - other[i]) <= NEAR * Math.max(1, Math.abs(x))));
}
