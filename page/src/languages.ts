// SPDX-License-Identifier: MIT
//
// Languages of the page besides English, by code. docs/translations.md says how to add one.

import type { LessonTexts } from "./lessons.ts";
import type { Words } from "./words.ts";

/** The page's words, and the texts of translated lessons; other lessons are shown in English. */
export interface Language {
  readonly words: Words;
  readonly lessons: Readonly<Record<string, LessonTexts>>;
}

export const LANGUAGES: Readonly<Record<string, Language>> = {};
