// SPDX-License-Identifier: MIT
//
// Printing: a lesson's title, the picture, its question and its steps with space for answers; without a lesson, the
// picture.

import type { Lesson } from "./lessons.ts";
import { make } from "./panel_elements.ts";
import type { Picture } from "./picture.ts";
import { words } from "./words.ts";

/** Adds a sheet to the page while it is printed. */
export function printsSheet(app: HTMLElement, picture: Picture, lesson: () => Lesson | null): void {
  let sheet: HTMLElement | null = null;
  const remove = (): void => { sheet?.remove(); sheet = null; };
  addEventListener("beforeprint", () => {
    remove();
    const texts = lesson()?.texts, still = make("img", { src: picture.still("#ffffff", true).toDataURL("image/png"), alt: words.picture.body });
    sheet = make("article", { id: "sheet" }, make("h1", {}, texts?.title ?? words.title), still,
      texts && make("h2", {}, texts.question), texts && make("ol", { class: "letters" }, ...texts.choices.map((choice) => make("li", {}, choice))),
      texts && make("ol", { class: "tasks" }, ...texts.steps.map((step) => make("li", {}, step))));
    app.append(sheet);
  });
  addEventListener("afterprint", remove);
}
