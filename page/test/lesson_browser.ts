// SPDX-License-Identifier: MIT
//
// For the page itself, with a lesson open in it: what lesson_player.ts does there, judged by what the page sees.

import type { Probe } from "../src/main.ts";
import { Player, playWrong, type Shown } from "./lesson_player.ts";

declare const page: Probe;

class AtPage extends Player {
  constructor() {
    const { lessons, motion } = page, desk = lessons["desk"], panel = lessons["panel"], shown: Shown = { ...lessons["sight"]() };
    super(lessons.lesson!, motion, new Proxy(shown, {
      set: (_, name, value) => {
        if (name === "cards") for (const card of value) panel.toggle(card);
        else if (name !== "ghost") Object.assign(desk.look, { [name]: value });
        return true;
      },
    }));
  }

  override look(): void {
    page.clock.setPaused(true);
    page.lessons["lookedMs"] = 0;
    page.lessons.look(this.motion.snapshot());
  }

  override answer(): void {
    page.lessons["answer"](this.lesson.texts.answer);
    this.look();
  }

  override restart(): void {
    document.getElementById("reset")!.click();
    this.look();
  }
}

const wrong = (name: string): Promise<string[]> => playWrong(name, async () => {
  await page.lessons.begin(name, document.body.classList.contains("class"));
  return new AtPage();
});
Object.assign(globalThis, { wrong });
