// SPDX-License-Identifier: MIT

import { button, make } from "./panel_elements.ts";
import type { NodeBehind, Wish } from "./source.ts";
import { words } from "./words.ts";

/** The state of the node's hand (who has control), and the buttons to get it. */
export class HandPane {
  readonly node = make("div", { id: "live", role: "status" });
  private readonly behind: NodeBehind;
  private shown = "";

  constructor(behind: NodeBehind) { this.behind = behind; }

  changed(): void {
    const { hand, isReached } = this.behind, w = words.live, all = JSON.stringify([hand, isReached]);
    if (all === this.shown) return;
    this.shown = all;
    const state = !isReached ? w.away : hand.yours ? w.yours : hand.locked && !hand.owner ? w.locked : hand.taken ? w.others : w.free;
    const wish = (text: string, what: Wish): HTMLElement => button(text, () => this.behind.wish(what), { "data-wish": what });
    const others = hand.watchers > 1, asks = hand.asking > 0 && hand.yours;
    // Two lines in every state, so that the sliders below don't move.
    this.node.replaceChildren(make("span", {}, state), isReached && asks ? make("b", {}, w.asking(hand.asking)) : isReached && others ? make("span", { class: "note" }, w.watching(hand.watchers)) : "",
      ...(isReached && (others || hand.locked) ? [make("div", {},
        hand.yours && others && wish(w.give, "give"),
        hand.taken && !hand.yours && !hand.owner && !hand.locked && (hand.asked ? w.asked : wish(w.ask, "ask")),
        hand.owner && hand.taken && !hand.yours && wish(w.take, "take"),
        hand.owner && wish(hand.locked ? w.unlock : w.lock, hand.locked ? "unlock" : "lock"))] : []));
  }
}
