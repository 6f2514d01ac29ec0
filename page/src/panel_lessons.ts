// SPDX-License-Identifier: MIT

import { addressOf, hashOf } from "./address.ts";
import type { Card, Desk } from "./panel.ts";
import { make } from "./panel_elements.ts";
import { words } from "./words.ts";

/** The card with links to all lessons. */
export function lessonsCard(desk: Desk): Card {
  const { language } = addressOf(location.hash);
  const list = make("ul", { class: "lessons" }, ...desk.lessons.map(({ name, title }) => make("li", {}, make("a", { href: hashOf({ lesson: name, language }) }, title))));
  return { node: make("div", {}, make("p", { class: "note" }, words.lessons.about), list), changed: () => undefined };
}
