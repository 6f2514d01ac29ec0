// SPDX-License-Identifier: MIT
//
// The languages of the page beside English, by their codes. How one is added: docs/translations.md.

import type { LessonTexts } from "./lessons.ts";
import type { Words } from "./words.ts";

/** The page's words, and the texts of those lessons that are translated; the others stay English. */
export interface Language {
  readonly words: Words;
  readonly lessons: Readonly<Record<string, LessonTexts>>;
}

export const LANGUAGES: Readonly<Record<string, Language>> = {};
