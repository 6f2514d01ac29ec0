# SPDX-License-Identifier: MIT
"""Another language: the page in one whose words are all marked, so that a text beside the catalogue shows."""

from __future__ import annotations

import json
import os
import re
import shutil
from dataclasses import asdict
from pathlib import Path

import pytest
from page_browser import NO_WEBGL, Opened, chromium
from page_tools import kernels, packages, run_node

from rigid_proto_ros.mass.engines import FORMS
from rigid_proto_ros.motion.integrators import INTEGRATORS
from rigid_proto_ros.page.bundle import SOURCE
from rigid_proto_ros.scene.lessons import lessons

pytestmark = pytest.mark.drawn

MARKED = """
import type { LessonTexts } from "./lessons.ts";
import { marked } from "../test/marked.ts";
import { english, type Words } from "./words.ts";

export interface Language { readonly words: Words; readonly lessons: Readonly<Record<string, LessonTexts>> }
const lessons: Readonly<Record<string, LessonTexts>> = LESSONS;
export const LANGUAGES: Readonly<Record<string, Language>> = { get xx() { return { words: marked(english), lessons }; } };
"""

SHOWN = """() => {
  const found = [];
  const walk = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  for (let node = walk.nextNode(); node; node = walk.nextNode())
    if (!/^(SCRIPT|STYLE|NOSCRIPT)$/.test(node.parentElement.tagName)) found.push(node.textContent);
  for (const node of document.querySelectorAll("body *"))
    for (const name of ["aria-label", "aria-valuetext", "title", "alt", "placeholder"]) if (node.hasAttribute(name)) found.push(node.getAttribute(name));
  return [document.title, ...found];
}"""
"""Every text of the page, shown or not, and every name for those who don't see it."""

PLAIN = {
    "kg",
    "mm",
    "rad",
    "rpm",
    "Lx",
    "Ly",
    "Lz",
    "xx",
    "xy",
    "xz",
    "yy",
    "yz",
    "zz",
    "Ixx",
    "Ixy",
    "Ixz",
    "Iyy",
    "Iyz",
    "Izz",
    *INTEGRATORS,
    *re.findall(r"\w+", " ".join(form.engine for form in FORMS.values())),
}
"""Units, symbols and names that all languages share."""


@pytest.fixture(scope="module")
def page_in_marks(page_file: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page with another language, added as docs/translations.md says."""
    folder = tmp_path_factory.mktemp("marked")
    page = folder / "page"
    shutil.copytree(SOURCE, page, ignore=shutil.ignore_patterns("node_modules", ".install*"))
    os.symlink(packages(), page / "node_modules")
    shutil.copy(SOURCE.parent / "LICENSE", folder)
    (folder / "benchmarks" / "results").mkdir(parents=True)
    shutil.copy(SOURCE.parent / "benchmarks" / "results" / "engines.csv", folder / "benchmarks" / "results")
    texts = {}
    for one in lessons():
        fields = asdict(one)
        texts[one.name] = {
            "title": f"⟦{one.title}⟧",
            "question": f"⟦{one.question}⟧",
            "choices": [f"⟦{choice}⟧" for choice in one.choices],
            "answer": fields["answer"],
            "steps": [f"⟦{step}⟧" for step in one.sentences],
            "reason": f"⟦{one.reason}⟧",
        }
    (page / "src" / "languages.ts").write_text(MARKED.replace("LESSONS", json.dumps(texts)), "utf-8")
    made = folder / "page.html"
    run_node(page / "build.mjs", kernels(), page_file, made)
    return made


def unmarked(page: Opened) -> list[str]:
    """What isn't in the catalogue, of all that the page says now."""
    page.drawn()
    left = [re.sub(r"⟦[^⟦⟧]*⟧", " ", re.sub(r"⟦[^⟦⟧]*⟧", " ", text)) for text in page.js(SHOWN)]
    return [text for text in left if any(word not in PLAIN for word in re.findall(r"[A-Za-z]\w+", text, re.ASCII))]


def test_every_word_that_shows_is_in_the_catalogue(page_in_marks: Path) -> None:
    # Words are the same without a picture, which costs a software renderer most.
    with chromium(NO_WEBGL) as browser:
        page = Opened(browser, address=f"{page_in_marks.as_uri()}#lang=xx")
        page.pause()
        assert page.js("document.documentElement.lang") == "xx" and page.js("document.title").startswith("⟦")
        assert unmarked(page) == []
        for card in ("lessons", "body", "world", "ghost", "tensor", "measure", "plots", "keep"):
            page.page.locator(f"button[data-card={card}]").click()
            assert unmarked(page) == [], card
            page.page.locator(f"button[data-card={card}]").click()
        page.js("location.hash = '#lesson=plumb_line&lang=xx'")
        page.page.wait_for_selector("#lesson .choice")
        assert unmarked(page) == []
        page.page.locator(".choice").nth(0).click()
        page.pause()
        page.page.locator("#lesson .pill").first.click()
        assert unmarked(page) == []
        page.page.get_by_role("button", name="class mode").click()
        assert unmarked(page) == []
        page.js("dispatchEvent(new Event('beforeprint'))")
        assert unmarked(page) == []
        page.context.close()  # that there is no WebGL is said to the console, too
